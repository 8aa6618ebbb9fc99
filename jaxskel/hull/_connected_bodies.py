"""The hulls of a batch as vertical runs of voxels, and the connected bodies that the runs form.

A person is some thousand runs, but tens of thousands of voxels, and two runs in neighbouring columns touch where they
overlap or miss each other by one: connectivity over faces, edges and corners, exactly.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Int

from .._math.components import connected, first_mentions
from ._grid import VoxelGrid
from ._visual_hulls import VisualHulls

# Columns beside, of each pair of opposite ones one.
_BESIDE = ((0, 1), (1, -1), (1, 0), (1, 1))


class Bodies(eqx.Module):
    """Runs by frame, then in the grid's order, and which body each belongs to."""

    frame: Int[np.ndarray, " runs"]
    first: Int[np.ndarray, " runs"]
    """Number of the lowest voxel among those of the hulls."""
    length: Int[np.ndarray, " runs"]
    """(voxels)"""
    body: Int[np.ndarray, " runs"]
    """Number of the body; bodies are numbered by frame, then in the order of their first voxel."""
    frame_of_body: Int[np.ndarray, " bodies"]
    sizes: Int[np.ndarray, " bodies"]
    """(voxels)"""

    def voxels_of(self, frame: int) -> Int[np.ndarray, " own"]:
        """Which body each occupied voxel of a frame belongs to."""
        runs = slice(*np.searchsorted(self.frame, [frame, frame + 1]))
        return np.repeat(self.body[runs], self.length[runs])


def find_bodies(hulls: VisualHulls) -> Bodies:
    """Split each hull into what is connected over faces, edges or corners."""
    frame, first, length = _runs(hulls)
    body = connected(*_touching(hulls, frame, first, length), len(frame))
    count = int(body.max(initial=-1)) + 1
    # By the first of their runs, not as the pairs come.
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
    """Pairs of runs of one frame that overlap or miss each other by one, in columns side by side."""
    x, y, z = hulls.voxels.take(first, axis=0).T.astype(np.int64)
    below, above = z - 1, z + length
    # One number for each column of grids with a margin, so that no neighbour is on the other side.
    width, columns = hulls.grid.shape[1] + 2, (hulls.grid.shape[0] + 2) * (hulls.grid.shape[1] + 2)
    column = frame * columns + (x + 1) * width + y + 1
    begins = np.append(0, np.cumsum(np.bincount(column, minlength=len(hulls) * columns)))
    one, other = [], []
    for along_x, along_y in _BESIDE:
        beside = column + along_x * width + along_y
        run, candidate, end = np.arange(len(column)), begins.take(beside), begins.take(beside + 1)
        # The runs of the other column in turn, of which there are few.
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
    """What is connected among some voxels of a grid, which come in its order."""
    return find_bodies(VisualHulls(voxels, np.ones((1, len(voxels)), bool), grid))


def _runs(hulls: VisualHulls) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frame, first voxel and length of each run."""
    x, y, z = np.ascontiguousarray(hulls.voxels.T)
    follows = (x[1:] == x[:-1]) & (y[1:] == y[:-1]) & (z[1:] == z[:-1] + 1)
    # Each voxel with the one before it, if both are inside.
    joined = np.zeros((len(hulls), len(hulls.voxels) + 1), bool)
    np.logical_and(hulls.inside[:, :-1], follows, out=joined[:, 1:-1])
    joined[:, 1:-1] &= hulls.inside[:, 1:]
    starts, ends = hulls.inside > joined[:, :-1], hulls.inside > joined[:, 1:]
    first, last = np.flatnonzero(starts), np.flatnonzero(ends)
    return *np.divmod(first, max(len(hulls.voxels), 1)), last - first + 1


def voxels_of_bodies(
    hulls: VisualHulls, bodies: Bodies, chosen: Bool[np.ndarray, " bodies"]
) -> Bool[np.ndarray, "frames voxels"]:
    """Which voxels belong to the chosen bodies."""
    inside = hulls.inside.copy()
    # Mostly specks are left out, which have few voxels.
    out = np.flatnonzero(~chosen[bodies.body])
    length = bodies.length[out]
    step = np.arange(length.sum()) - np.repeat(np.cumsum(length) - length, length)
    inside[np.repeat(bodies.frame[out], length), np.repeat(bodies.first[out], length) + step] = False
    return inside
