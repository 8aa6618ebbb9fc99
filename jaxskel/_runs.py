"""The hulls of a batch as vertical runs of voxels, and the connected bodies that the runs form.

A person is some thousand runs, but tens of thousands of voxels, and two runs in neighbouring columns touch where they
overlap or miss each other by one: connectivity over faces, edges and corners, exactly.
"""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Int

from ._connected import connected
from ._grid import VoxelGrid
from ._hull import VisualHulls

# Columns beside, of each pair of opposite ones one.
_BESIDE = ((0, 1), (1, -1), (1, 0), (1, 1))


class Bodies(eqx.Module):
    """Runs by frame, then in the grid's order, and which body each belongs to."""

    frame: Int[np.ndarray, " runs"]
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
    _, width, height = (size + 2 for size in hulls.grid.shape)
    x, y, z = hulls.voxels[first].T.astype(np.int64)
    # One number for each place of a grid with a margin, so that no neighbour is on the other side.
    low = ((frame * (hulls.grid.shape[0] + 2) + x + 1) * width + y + 1) * height + z + 1
    high = low + length - 1
    rows, columns = [], []
    for along_x, along_y in _BESIDE:
        shift = (along_x * width + along_y) * height
        start = np.searchsorted(high, low + shift - 1)
        count = np.maximum(np.searchsorted(low, high + shift + 1, "right") - start, 0)
        rows.append(np.repeat(np.arange(len(low)), count))
        columns.append(np.arange(count.sum()) + np.repeat(start - np.cumsum(count) + count, count))
    row, column = np.concatenate(rows), np.concatenate(columns)
    body = connected(row, column, len(low))
    # By the first of their runs, not as the pairs come.
    _, first_run, body = np.unique(body, return_index=True, return_inverse=True)
    order = np.argsort(first_run)
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    body = number[body]
    return Bodies(frame, length, body, frame[first_run[order]], np.bincount(body, length, len(order)).astype(int))


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
    inside = np.zeros_like(hulls.inside)
    inside[hulls.inside] = np.repeat(chosen[bodies.body], bodies.length)
    return inside
