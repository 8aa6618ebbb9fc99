"""Two tracks that face opposite ways, and which of them a film follows: all its frames decide, later ones too."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float, Int

from ._cheapest_path import cheapest_paths, costs_through
from ._hypotheses import Hypotheses


class Fork(NamedTuple):
    """Two tracks through consecutive frames: one that goes on from the pose chosen before, and one from its rival.

    Attributes:
        both: A hypothesis of each track, with axes ``frames tracks``.
        others: Further hypotheses that go with each track.
        jumps: Cost of changing from a track to the other after each frame.
        first: Cost of beginning on each track: how much more the cheapest path to it costs than the cheapest one.
        alike: Number of successive frames whose costs err alike.
    """

    both: Hypotheses
    others: tuple[Hypotheses, Hypotheses]
    jumps: Float[np.ndarray, "frames tracks=2 tracks=2"]
    first: Float[np.ndarray, " tracks=2"]
    alike: int

    def hypotheses(self, path: Int[np.ndarray, " frames"], through: Float[np.ndarray, "frames tracks=2"]) -> Hypotheses:
        """The hypotheses of each frame: that of a path, that of the other track, and those that go with the path's.

        That of the other track costs as much more as the cheapest path through it, divided by the number of frames
        whose costs err alike.

        Args:
            path: The track that is followed in each frame.
            through: Cost of the cheapest path through each track in each frame.
        """
        rows = np.arange(len(path))
        ordered = self.both.ordered(np.stack([path, 1 - path], 1))
        others = jax.tree.map(lambda *of: np.stack(of, 1)[rows, path], *self.others)
        excess = np.maximum(through[rows, 1 - path] - through[rows, path], 0.0)
        best = ordered.cost[:, 0]
        either = replace(ordered, cost=np.stack([best, best + excess / self.alike], 1).astype(np.float32))
        return either.joined(others)


class Decided(NamedTuple):
    """The path through the frames of some forks.

    Attributes:
        path: The track of each frame.
        through: Cost of the cheapest path through each track.
        settled: How many of the first frames are decided, whatever later forks say.
    """

    path: Int[np.ndarray, " frames"]
    through: Float[np.ndarray, "frames tracks=2"]
    settled: int


def decide(forks: Sequence[Fork]) -> Decided:
    """The cheapest path through forks of which each goes on from the one before."""
    jumps = [np.array(fork.jumps) for fork in forks]
    ends = [track_after(fork) for fork in forks]
    for end, last in zip(ends[:-1], jumps, strict=False):
        # The next fork's first track goes on from the one that was the cheaper one here; nothing jumps there.
        last[-1] = np.where(np.eye(2, dtype=bool)[:, [end, 1 - end]], 0.0, np.inf)
    paths = np.concatenate([fork.both.cost for fork in forks]), np.concatenate(jumps), forks[0].first
    ways = cheapest_paths(*paths)[1]
    differ = np.flatnonzero(ways[0] != ways[1])
    return Decided(ways[ends[-1]], costs_through(*paths), int(differ[0]))


def track_after(fork: Fork) -> int:
    """The track on which the cheapest path so far ends: the next fork's first track goes on from it."""
    return int(cheapest_paths(fork.both.cost, fork.jumps, fork.first)[0].argmin())
