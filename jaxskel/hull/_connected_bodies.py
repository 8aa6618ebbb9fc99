"""Connected bodies of the hulls of a batch, found from vertical runs of voxels.

A person has some thousand runs, but tens of thousands of voxels. Two runs in neighbouring columns touch if their z
ranges overlap or adjoin: this is exact connectivity over faces, edges and corners.
"""

from dataclasses import dataclass

import numpy as np
from jax.tree_util import register_dataclass
from jaxtyping import Bool, Int

from .._math.components import connected, first_mentions, ranks
from ._grid import VoxelGrid
from ._visual_hulls import VisualHulls

# Offsets to neighbouring columns: across a face, one of each pair of opposite ones, and across an edge.
_ACROSS_FACES = ((0, 1), (1, 0))
_ACROSS_EDGES = ((1, 1), (1, -1), (-1, 1), (-1, -1))


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
    runs = _Runs(hulls)
    body = connected(*runs.touching(np.arange(len(runs.frame)), _ACROSS_FACES), len(runs.frame))
    # Over faces a person is one large component already. Whatever else is connected, a smaller one is part of it.
    sizes = np.bincount(body, runs.length)
    ascending = sizes.argsort(kind="stable")
    largest = np.zeros(len(hulls), np.int64)
    largest[runs.frame.take(first_mentions(body, len(sizes))).take(ascending)] = ascending
    smaller = (body != largest.take(runs.frame)).nonzero()[0]
    one, other = runs.touching(smaller, _ACROSS_EDGES)
    body = connected(body.take(one), body.take(other), len(sizes)).take(body)
    count = int(body.max(initial=-1)) + 1
    # Number bodies by their first run, independently of the order of the pairs.
    first_run = first_mentions(body, count)
    order = np.argsort(first_run)
    body = ranks(order).take(body)
    sizes = np.bincount(body, runs.length, count).astype(int)
    return Bodies(runs.frame, runs.first, runs.length, body, runs.frame[first_run[order]], sizes)


class _Runs:
    """Runs of the hulls of a batch, and which of them touch.

    Attributes:
        frame: Frame of each run.
        first: Index of the run's lowest voxel in ``hulls.voxels``.
        length: Number of voxels of each run.
    """

    def __init__(self, hulls: VisualHulls):
        self.frame, self.first, self.length = _runs(hulls)
        x, y, self._low = hulls.voxels.take(self.first, axis=0).T.astype(np.int64)
        self._high = self._low + self.length
        # Number the columns of grids with a margin, so that neighbours do not wrap around.
        self._width, columns = hulls.grid.shape[1] + 2, (hulls.grid.shape[0] + 2) * (hulls.grid.shape[1] + 2)
        self._column = self.frame * columns + (x + 1) * self._width + y + 1
        self._begins = np.append(0, np.cumsum(np.bincount(self._column, minlength=len(hulls) * columns)))

    def touching(
        self, some: Int[np.ndarray, " some"], beside: tuple[tuple[int, int], ...]
    ) -> tuple[Int[np.ndarray, " pairs"], Int[np.ndarray, " pairs"]]:
        """Pairs of some runs and those of neighbouring columns, `beside` them along x and y, that they touch."""
        one, other = [some[:0]], [some[:0]]
        for along_x, along_y in beside:
            column = self._column.take(some) + along_x * self._width + along_y
            run, candidate, end = some, self._begins.take(column), self._begins.take(column + 1)
            # Step through the few runs of the neighbouring column.
            while True:
                more = (candidate < end).nonzero()[0]
                if not len(more):
                    break
                run, candidate, end = run.take(more), candidate.take(more), end.take(more)
                below, above = self._low.take(candidate), self._high.take(candidate)
                touch = ((below <= self._high.take(run)) & (above >= self._low.take(run))).nonzero()[0]
                one.append(run.take(touch))
                other.append(candidate.take(touch))
                candidate = candidate + 1
        return np.concatenate(one), np.concatenate(other)


def bodies_among(voxels: Int[np.ndarray, "n 3"], grid: VoxelGrid) -> Bodies:
    """Connected bodies among some voxels of a grid (indices x, y, z), given in grid order."""
    return find_bodies(VisualHulls(voxels, np.ones((1, len(voxels)), bool), grid))


def _runs(hulls: VisualHulls) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frame, first voxel and length of each run."""
    x, y, z = np.ascontiguousarray(hulls.voxels.T)
    follows = (x[1:] == x[:-1]) & (y[1:] == y[:-1]) & (z[1:] == z[:-1] + 1)
    first, last = [], []
    for f in range(len(hulls)):
        span = hulls.span(f)
        starts = hulls.inside[f, span].copy()
        ends = starts.copy()
        # Join each voxel to the one before it if both are occupied.
        joined = starts[1:] & starts[:-1]
        joined &= follows[span.start : span.start + len(joined)]
        starts[1:] ^= joined
        ends[:-1] ^= joined
        first.append(starts.nonzero()[0] + span.start)
        last.append(ends.nonzero()[0] + span.start)
    frame = np.arange(len(hulls)).repeat([len(own) for own in first])
    none = np.zeros(0, np.int64)
    first = np.concatenate([none, *first])
    return frame, first, np.concatenate([none, *last]) - first + 1


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
