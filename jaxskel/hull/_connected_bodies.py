"""Connected bodies of the hulls of a batch, found from vertical runs of voxels.

Two runs in neighbouring columns touch if their z ranges overlap or adjoin: this is exact connectivity over faces, edges
and corners.
"""

from dataclasses import dataclass

import numpy as np
from jax.tree_util import register_dataclass
from jaxtyping import Int

from .._math.components import connected, first_mentions, ranks
from ._grid import VoxelGrid
from ._runs import Runs
from ._visual_hulls import VisualHulls

# Offsets to neighbouring columns: across a face, one of each pair of opposite ones, and across an edge.
_ACROSS_FACES = ((0, 1), (1, 0))
_ACROSS_EDGES = ((1, 1), (1, -1), (-1, 1), (-1, -1))


@register_dataclass
@dataclass(frozen=True, eq=False)
class Bodies:
    """The connected body of each run of voxels.

    Attributes:
        runs: The runs of the hulls, as they have them.
        body: Index of the body of each run; bodies are numbered by frame, then in the order of their first voxel.
        sizes: Number of voxels of each body.
    """

    runs: Runs
    body: Int[np.ndarray, " runs"]
    frame_of_body: Int[np.ndarray, " bodies"]
    sizes: Int[np.ndarray, " bodies"]

    def voxels_of(self, frame: int) -> Int[np.ndarray, " own"]:
        """Body of each occupied voxel of a frame."""
        own = self.runs.within(frame)
        return np.repeat(self.body[own], self.runs.length[own])


def find_bodies(hulls: VisualHulls) -> Bodies:
    """Split each hull into components that are connected over faces, edges or corners (26-neighbourhood)."""
    runs, neighbours = hulls.runs, _Neighbours(hulls)
    body = connected(*neighbours.touching(np.arange(len(runs.frame)), _ACROSS_FACES), len(runs.frame))
    # Over faces a person is one large component already. Whatever else is connected, a smaller one is part of it.
    sizes = np.bincount(body, runs.length)
    ascending = sizes.argsort(kind="stable")
    largest = np.zeros(len(hulls), np.int64)
    largest[runs.frame.take(first_mentions(body, len(sizes))).take(ascending)] = ascending
    smaller = (body != largest.take(runs.frame)).nonzero()[0]
    one, other = neighbours.touching(smaller, _ACROSS_EDGES)
    body = connected(body.take(one), body.take(other), len(sizes)).take(body)
    count = int(body.max(initial=-1)) + 1
    # Number bodies by their first run, independently of the order of the pairs.
    first_run = first_mentions(body, count)
    order = np.argsort(first_run)
    body = ranks(order).take(body)
    return Bodies(runs, body, runs.frame[first_run[order]], np.bincount(body, runs.length, count).astype(int))


class _Neighbours:
    """Which runs of hulls touch each other."""

    def __init__(self, hulls: VisualHulls):
        frame, first, length = hulls.runs
        x, y, self._low = hulls.voxels.take(first, axis=0).T.astype(np.int64)
        self._high = self._low + length
        # Number the columns of grids with a margin, so that neighbours do not wrap around.
        self._width, columns = hulls.grid.shape[1] + 2, (hulls.grid.shape[0] + 2) * (hulls.grid.shape[1] + 2)
        self._column = frame * columns + (x + 1) * self._width + y + 1
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
