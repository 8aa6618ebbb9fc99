"""Vertical runs of occupied voxels: a person has some thousand runs, but tens of thousands of voxels."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int


class Runs(NamedTuple):
    """Runs of the hulls of a batch, sorted by frame and then in grid order.

    Attributes:
        first: Index of the run's lowest voxel among the voxels of all hulls.
        length: Number of voxels of each run.
    """

    frame: Int[np.ndarray, " runs"]
    first: Int[np.ndarray, " runs"]
    length: Int[np.ndarray, " runs"]

    @property
    def last(self) -> Int[np.ndarray, " runs"]:
        """Index of the run's highest voxel."""
        return self.first + self.length - 1

    def within(self, frame: int | np.integer) -> slice:
        """Where the runs of a frame are."""
        return slice(*np.searchsorted(self.frame, [int(frame), int(frame) + 1]).tolist())

    def of(self, frame: int | np.integer) -> "Runs":
        """The runs of a frame."""
        own = self.within(frame)
        return Runs(*(array[own] for array in self))

    def of_frames(self, frames: Int[np.ndarray, " some"]) -> "Runs":
        """The runs of some frames, which are numbered anew, from 0."""
        starts, ends = np.searchsorted(self.frame, frames), np.searchsorted(self.frame, frames + 1)
        some = np.concatenate([np.arange(0), *map(np.arange, starts, ends)])
        return Runs(np.arange(len(frames)).repeat(ends - starts), self.first.take(some), self.length.take(some))

    def chosen(self, some: Bool[np.ndarray, " runs"]) -> "Runs":
        """Some of the runs."""
        return Runs(*(array.compress(some) for array in self))

    @property
    def voxels(self) -> Int[np.ndarray, " own"]:
        """Indices of all their voxels, run by run."""
        ends = self.length.cumsum()
        return np.arange(ends[-1] if len(ends) else 0) + (self.first - ends + self.length).repeat(self.length)


def runs_of(voxels: Int[np.ndarray, "voxels 3"], inside: Bool[np.ndarray, "frames voxels"]) -> Runs:
    """The runs of some hulls, see `VisualHulls`."""
    x, y, z = np.ascontiguousarray(voxels.T)
    follows = (x[1:] == x[:-1]) & (y[1:] == y[:-1]) & (z[1:] == z[:-1] + 1)
    first, last = [np.arange(0)], [np.arange(0)]
    for own in inside:
        starts, ends = own.copy(), own.copy()
        # Join each voxel to the one before it if both are occupied.
        joined = own[1:] & own[:-1]
        joined &= follows
        starts[1:] ^= joined
        ends[:-1] ^= joined
        first.append(starts.nonzero()[0])
        last.append(ends.nonzero()[0])
    frame = np.arange(len(inside)).repeat([len(own) for own in first[1:]])
    starts = np.concatenate(first)
    return Runs(frame, starts, np.concatenate(last) - starts + 1)
