"""The voxels of a batch of frames as one graph, and which of them a wave of clusters has not reached yet.

All frames lie one after the other in one array, each in a box of the same size with an empty margin, so that a
neighbour is a constant number of elements away. What depends on a voxel's x and y is stored for each row of voxels
along z: one division finds it.
"""

import numpy as np
from jaxtyping import Float, Int

from ._hull import VisualHulls

_NEIGHBOURS = np.array([o for o in np.ndindex(3, 3, 3) if o != (1, 1, 1)]) - 1

# Voxels whose neighbours are looked at at once: what is written stays in the processor's cache until it is read.
_AT_ONCE = 2048
# The numbers of their neighbours, upwards and downwards: they fit into 16 bits.
_UP = np.arange(_AT_ONCE * len(_NEIGHBOURS), dtype=np.uint16)
_DOWN = _UP[::-1].copy()


class Wave:
    """Voxels are numbered by frame times the size of a box, plus the place in the box; every frame must have some."""

    def __init__(self, hulls: VisualHulls):
        axes = np.ascontiguousarray(hulls.voxels.T)
        # Voxels stand in the grid's order: x is least in the first and greatest in the last one.
        own = [[axis.take(index) for axis in axes] for index in map(np.flatnonzero, hulls.inside)]
        low = np.array([[x[0], y.min(), z.min()] for x, y, z in own], np.int64) - 1
        high = np.array([[x[-1], y.max(), z.max()] for x, y, z in own], np.int64) + 2
        low[:, 2] = low[:, 2].min()  # the same in all frames, so that z alone says how high a voxel lies
        self.low = low
        """Corner of each frame's box on the grid."""
        extent = (high - low).max(0)
        self.shape = tuple(int(n) for n in extent + extent % 2)
        """Of each box; even, because it is made of cells of 2 x 2 x 2 voxels."""
        rows, depth = self.shape[0] * self.shape[1], self.shape[2]
        self._steps = np.tile(_NEIGHBOURS @ np.array([self.shape[1] * depth, depth, 1]), _AT_ONCE)
        self._found = np.empty(self._steps.shape, bool)
        self._open = np.zeros(len(hulls) * rows * depth, bool)
        self._mention = np.empty(len(self._open), np.uint16)
        for box, (x0, y0, z0), (x, y, z) in zip(self._open.reshape(len(hulls), -1), low.tolist(), own, strict=True):
            box[((x - x0) * self.shape[1] + (y - y0)) * depth + (z - z0)] = True
        corner, spacing = np.asarray(hulls.grid.origin), hulls.grid.spacing
        x, y, z = (corner[i] + spacing * (low[:, i, None] + np.arange(n) + 0.5) for i, n in enumerate(self.shape))
        # By row: the centre, and where the row lies among the cells.
        self._x, self._y, self._z = x.repeat(self.shape[1]), np.tile(y, self.shape[0]).reshape(-1), z[0]
        row = np.arange(len(self._x))
        plane = row // self.shape[1]
        across = row - plane * self.shape[1]
        self._cell = ((plane >> 1) * (self.shape[1] >> 1) + (across >> 1)) * (depth >> 1)
        self._corner = (4 * (plane & 1) + 2 * (across & 1)).astype(np.uint8)

    def number(self, frames: Int[np.ndarray, " n"], places: Int[np.ndarray, "n 3"]) -> Int[np.ndarray, " n"]:
        """Voxels by frame and place on the grid."""
        x, y, z = (places - self.low[frames]).T
        return ((frames * self.shape[0] + x) * self.shape[1] + y) * self.shape[2] + z

    def cells(self, voxels: Int[np.ndarray, " n"]) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"]]:
        """The cell of each voxel, and which of its eight corners the voxel is; see `Cells`."""
        row = voxels // self.shape[2]
        z = voxels - row * self.shape[2]
        return self._cell.take(row) + (z >> 1), self._corner.take(row) + (z & 1)

    def centres(self, voxels: Int[np.ndarray, " n"]) -> Float[np.ndarray, "3 n"]:
        """Centres of voxels in the world (m), by axis: long rows of numbers are faster than many short ones."""
        row = voxels // self.shape[2]
        xyz = np.empty((3, len(voxels)))
        self._x.take(row, out=xyz[0], mode="clip")
        self._y.take(row, out=xyz[1], mode="clip")
        self._z.take(voxels - row * self.shape[2], out=xyz[2], mode="clip")
        return xyz

    def close(self, voxels: Int[np.ndarray, " n"]) -> None:
        """The wave has reached them."""
        self._open[voxels] = False

    def reopen(self, voxels: Int[np.ndarray, " n"]) -> None:
        """The wave has seen them, but left them to whoever comes next."""
        self._open[voxels] = True

    def step(
        self, voxels: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]
    ) -> tuple[Int[np.ndarray, " reached"], Int[np.ndarray, " reached"]]:
        """Close the open neighbours of some voxels; each goes to the owner of the first of these that it touches."""
        reached, whose = [voxels[:0]], [owners[:0]]
        for start in range(0, len(voxels), _AT_ONCE):
            around = voxels[start : start + _AT_ONCE].repeat(len(_NEIGHBOURS))
            around += self._steps[: len(around)]
            found = self._found[: len(around)]
            hit = np.flatnonzero(self._open.take(around, out=found, mode="clip"))
            around = around.take(hit)
            first = self._first(around)
            reached.append(around.take(first))
            self.close(reached[-1])  # who comes later does not even see them
            whose.append(owners.take(start + hit.take(first) // len(_NEIGHBOURS)))
        return np.concatenate(reached), np.concatenate(whose)

    def close_first(
        self, voxels: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]
    ) -> tuple[Int[np.ndarray, " open"], Int[np.ndarray, " open"]]:
        """Close those of some voxels that are open, by owner; of several mentions of a voxel the first counts."""
        order = stable_order(owners)
        voxels, owners = voxels.take(order), owners.take(order)
        kept = [order[:0]]
        for start in range(0, len(voxels), len(_UP)):
            some = voxels[start : start + len(_UP)]
            still = np.flatnonzero(self._open.take(some, mode="clip"))
            still = still.take(self._first(some.take(still)))
            self.close(some.take(still))
            kept.append(start + still)
        index = np.concatenate(kept)
        return voxels.take(index), owners.take(index)

    def _first(self, voxels: np.ndarray) -> np.ndarray:
        """The first mention of every voxel, by index."""
        # The last write, which is the first mention, stays. Copies turned round are faster than views.
        self._mention[voxels[::-1].copy()] = _DOWN[len(_DOWN) - len(voxels) :]
        return np.flatnonzero(self._mention.take(voxels, mode="clip") == _UP[: len(voxels)])


def stable_order(numbers: Int[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
    """What sorts small numbers without exchanging equal ones. Short integers are sorted in a fraction of the time."""
    short = len(numbers) == 0 or numbers.max() < 2**16
    return np.argsort(numbers.astype(np.uint16) if short else numbers, kind="stable")
