"""The voxels of a batch of frames as one graph, and which of them a wave of clusters has not reached yet.

All frames lie one after the other in one array, each in a box of the same size with an empty margin, so that a
neighbour is a constant number of elements away.
"""

import numpy as np
from jaxtyping import Float, Int

from ._hull import VisualHulls

_NEIGHBOURS = np.array([o for o in np.ndindex(3, 3, 3) if o != (1, 1, 1)]) - 1

# Voxels whose neighbours are looked at at once: what is written stays in the processor's cache until it is read.
_AT_ONCE = 1024


class Wave:
    """Voxels are numbered by frame times the size of a box, plus the place in the box; every frame must have some."""

    def __init__(self, hulls: VisualHulls):
        axes = np.ascontiguousarray(hulls.voxels.T)
        inside = [np.flatnonzero(one) for one in hulls.inside]
        # Voxels stand in the grid's order: x is least in the first and greatest in the last one.
        own = [[axes[0].take(index[[0, -1]]), axes[1].take(index), axes[2].take(index)] for index in inside]
        self.low = np.array([[int(axis.min()) - 1 for axis in one] for one in own])
        """Corner of each frame's box on the grid."""
        extent = np.array([[int(axis.max()) + 2 for axis in one] for one in own])
        extent = (extent - self.low).max(0)
        self.shape = tuple(int(n) for n in extent + extent % 2)
        """Of each box; even, because it is made of cells of 2 x 2 x 2 voxels."""
        self.size = int(np.prod(self.shape))
        strides = np.array([self.shape[1] * self.shape[2], self.shape[2], 1])
        self._steps = _NEIGHBOURS @ strides
        # What each step writes first, and over again.
        self._around = np.empty((_AT_ONCE, len(_NEIGHBOURS)), np.int64)
        self._found = np.empty(self._around.shape, bool)
        self._open = np.zeros(len(hulls) * self.size, bool)
        self._mention = np.empty(len(hulls) * self.size, np.int32)
        places = strides @ axes.astype(np.int64)
        for frame, index in enumerate(inside):
            self._open[places.take(index) + (frame * self.size - int(strides @ self.low[frame]))] = True
        corner, spacing = np.asarray(hulls.grid.origin), hulls.grid.spacing
        self._axes = [
            (corner[i] + spacing * (self.low[:, i, None] + np.arange(n) + 0.5)).reshape(-1)
            for i, n in enumerate(self.shape)
        ]

    def number(self, frames: Int[np.ndarray, " n"], places: Int[np.ndarray, "n 3"]) -> Int[np.ndarray, " n"]:
        """Voxels by frame and place on the grid."""
        x, y, z = (places - self.low[frames]).T
        return ((frames * self.shape[0] + x) * self.shape[1] + y) * self.shape[2] + z

    def coordinates(self, voxels: Int[np.ndarray, " n"]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Frame of each voxel, and its x, y and z in the frame's box."""
        frame, row = voxels // self.size, voxels // self.shape[2]
        plane = row // self.shape[1]
        return frame, plane - frame * self.shape[0], row - plane * self.shape[1], voxels - row * self.shape[2]

    def centres(self, frame: np.ndarray, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> list[Float[np.ndarray, " n"]]:
        """Centres of voxels in the world (m), by axis: long rows of numbers are faster than many short ones."""
        return [axis.take(frame * n + place) for axis, n, place in zip(self._axes, self.shape, (x, y, z), strict=True)]

    def close(self, voxels: Int[np.ndarray, " n"]) -> None:
        """The wave has reached them."""
        self._open[voxels] = False

    def step(
        self, voxels: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]
    ) -> tuple[Int[np.ndarray, " reached"], Int[np.ndarray, " reached"]]:
        """Open neighbours of some voxels, each with the owner of the first voxel that it is a neighbour of."""
        hits, founds = [], []
        for start in range(0, len(voxels), _AT_ONCE):
            some = voxels[start : start + _AT_ONCE, None]
            around, found = self._around[: len(some)], self._found[: len(some)]
            hit = np.flatnonzero(self._open.take(np.add(some, self._steps, out=around), out=found, mode="clip"))
            founds.append(around.reshape(-1).take(hit))
            hits.append(hit + start * len(self._steps))
        hit, found = np.concatenate(hits), np.concatenate(founds)
        first = self._first(found)
        return found.take(first), owners.take(hit.take(first) // len(self._steps))

    def still_open(
        self, voxels: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]
    ) -> tuple[Int[np.ndarray, " open"], Int[np.ndarray, " open"]]:
        """Those of some voxels that are open, by owner; of several mentions of a voxel the first."""
        still = np.flatnonzero(self._open.take(voxels, mode="clip"))
        still = still.take(stable_order(owners.take(still)))
        voxels, owners = voxels.take(still), owners.take(still)
        first = self._first(voxels)
        return voxels.take(first), owners.take(first)

    def _first(self, voxels: np.ndarray) -> np.ndarray:
        """The first mention of every voxel, by index."""
        index = np.arange(len(voxels), dtype=np.int32)
        # The last write, which is the first mention, stays. Copies turned round are faster than views.
        self._mention[voxels[::-1].copy()] = index[::-1].copy()
        return np.flatnonzero(self._mention.take(voxels, mode="clip") == index)


def stable_order(numbers: Int[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
    """What sorts small numbers without exchanging equal ones. Short integers are sorted in a fraction of the time."""
    short = len(numbers) == 0 or numbers.max() < 2**16
    return np.argsort(numbers.astype(np.uint16) if short else numbers, kind="stable")
