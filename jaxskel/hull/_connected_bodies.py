"""Connected bodies of the hulls of a batch, found from vertical runs of voxels.

A person has some thousand runs, but tens of thousands of voxels. Two runs in neighbouring columns touch if their z
ranges overlap or adjoin: this is exact connectivity over faces, edges and corners.
"""

from dataclasses import dataclass

import numpy as np
from jax.tree_util import register_dataclass
from jaxtyping import Bool, Int

from .._math.components import connected, first_mentions
from ._grid import VoxelGrid
from ._visual_hulls import VisualHulls

# Offsets to neighbouring columns, one of each pair of opposite ones.
_BESIDE = ((0, 1), (1, -1), (1, 0), (1, 1))


@register_dataclass
@dataclass(frozen=True, eq=False)
class Bodies:
    """Runs of voxels, sorted by frame and then in grid order, and the connected body of each.

    Attributes:
        first: Index of the run's lowest voxel in ``hulls.voxels``.
        length: Number of voxels of each run.
        body: Index of the body; bodies are numbered by frame, then in the order of their first voxel.
        sizes: Number of voxels of each body.
    """

    frame: Int[np.ndarray, " runs"]
    first: Int[np.ndarray, " runs"]
    length: Int[np.ndarray, " runs"]
    body: Int[np.ndarray, " runs"]
    frame_of_body: Int[np.ndarray, " bodies"]
    sizes: Int[np.ndarray, " bodies"]

    def voxels_of(self, frame: int) -> Int[np.ndarray, " own"]:
        """Body of each occupied voxel of a frame."""
        runs = slice(*np.searchsorted(self.frame, [frame, frame + 1]))
        return np.repeat(self.body[runs], self.length[runs])


def find_bodies(hulls: VisualHulls) -> Bodies:
    """Split each hull into components that are connected over faces, edges or corners (26-neighbourhood)."""
    frame, first, length = _runs(hulls)
    body = connected(*_touching(hulls, frame, first, length), len(frame))
    count = int(body.max(initial=-1)) + 1
    # Number bodies by their first run, independently of the order of the pairs.
    first_run = first_mentions(body, count)
    order = np.argsort(first_run)
    number = np.empty_like(order)
    number[order] = np.arange(count)
    body = number[body]
    return Bodies(frame, first, length, body, frame[first_run[order]], np.bincount(body, length, count).astype(int))


def _touching(
    hulls: VisualHulls,
    frame: Int[np.ndarray, " runs"],
    first: Int[np.ndarray, " runs"],
    length: Int[np.ndarray, " runs"],
) -> tuple[Int[np.ndarray, " pairs"], Int[np.ndarray, " pairs"]]:
    """Pairs of runs of the same frame that touch, in neighbouring columns."""
    x, y, z = hulls.voxels.take(first, axis=0).T.astype(np.int64)
    below, above = z - 1, z + length
    # Number the columns of grids with a margin, so that neighbours do not wrap around.
    width, columns = hulls.grid.shape[1] + 2, (hulls.grid.shape[0] + 2) * (hulls.grid.shape[1] + 2)
    column = frame * columns + (x + 1) * width + y + 1
    begins = np.append(0, np.cumsum(np.bincount(column, minlength=len(hulls) * columns)))
    one, other = [], []
    for along_x, along_y in _BESIDE:
        beside = column + along_x * width + along_y
        run, candidate, end = np.arange(len(column)), begins.take(beside), begins.take(beside + 1)
        # Step through the few runs of the neighbouring column.
        while True:
            more = (candidate < end).nonzero()[0]
            if not len(more):
                break
            run, candidate, end = run.take(more), candidate.take(more), end.take(more)
            low, high = z.take(candidate), above.take(candidate)
            touch = ((low <= above.take(run)) & (high > below.take(run))).nonzero()[0]
            one.append(run.take(touch))
            other.append(candidate.take(touch))
            candidate = candidate + 1
    none = np.zeros(0, np.int64)
    return np.concatenate([none, *one]), np.concatenate([none, *other])


def bodies_among(voxels: Int[np.ndarray, "n 3"], grid: VoxelGrid) -> Bodies:
    """Connected bodies among some voxels of a grid (indices x, y, z), given in grid order."""
    return find_bodies(VisualHulls(voxels, np.ones((1, len(voxels)), bool), grid))


def _runs(hulls: VisualHulls) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frame, first voxel and length of each run."""
    x, y, z = np.ascontiguousarray(hulls.voxels.T)
    follows = (x[1:] == x[:-1]) & (y[1:] == y[:-1]) & (z[1:] == z[:-1] + 1)
    # Join each voxel to the one before it if both are occupied.
    joined = np.zeros((len(hulls), len(hulls.voxels) + 1), bool)
    np.logical_and(hulls.inside[:, :-1], follows, out=joined[:, 1:-1])
    joined[:, 1:-1] &= hulls.inside[:, 1:]
    starts, ends = hulls.inside > joined[:, :-1], hulls.inside > joined[:, 1:]
    first, last = np.flatnonzero(starts), np.flatnonzero(ends)
    return *np.divmod(first, max(len(hulls.voxels), 1)), last - first + 1


def voxels_of_bodies(
    hulls: VisualHulls, bodies: Bodies, chosen: Bool[np.ndarray, " bodies"]
) -> Bool[np.ndarray, "frames voxels"]:
    """Mask of the voxels that belong to the chosen bodies."""
    inside = hulls.inside.copy()
    # Clear the other bodies, which are mostly specks of few voxels.
    out = np.flatnonzero(~chosen[bodies.body])
    length = bodies.length[out]
    step = np.arange(length.sum()) - np.repeat(np.cumsum(length) - length, length)
    inside[np.repeat(bodies.frame[out], length), np.repeat(bodies.first[out], length) + step] = False
    return inside
