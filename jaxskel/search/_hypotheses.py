"""Hypotheses: poses of some frames and what they cost, loose while they are searched for, in rows in the end."""

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from .._runtime.batching import take
from ..body import SEGMENT_NAMES, Pose

# Two poses are alike if their roots are closer than this (m) and no entry of a rotation differs by more.
_APART, _TURNED = 0.02, 0.1
_ALL = np.arange(len(SEGMENT_NAMES))


class Hypotheses(eqx.Module):
    """Poses of some frames, the same number of each, the cheapest first."""

    poses: Pose
    """Axes ``frames hypotheses``."""
    cost: Float[np.ndarray, "frames hypotheses"]

    @property
    def best(self) -> Pose:
        """The cheapest of each frame, without the axis of hypotheses."""
        return jax.tree.map(lambda a: a[:, 0], self.poses)

    def ordered(self, order: Int[np.ndarray, "frames some"]) -> "Hypotheses":
        """Some of each frame's hypotheses, in an order of its own."""
        rows = np.arange(len(order))[:, None]
        return jax.tree.map(lambda a: a[rows, order], self)


class Pool(eqx.Module):
    """Poses of frames of a stack, any number of each."""

    frame: Int[np.ndarray, " n"]
    """Which frame each is of."""
    poses: Pose
    """Axis ``n``."""
    cost: Float[np.ndarray, " n"]
    """Infinite as long as it is not known."""

    def __len__(self) -> int:
        return len(self.frame)

    def joined(self, other: "Pool") -> "Pool":
        """These and others."""
        return jax.tree.map(lambda a, b: np.concatenate([a, b]), self, other)

    def cheapest(self, count: int) -> "Pool":
        """At most so many of each frame, frame by frame, the cheapest first."""
        order = np.lexsort((self.cost, self.frame))
        frame = self.frame[order]
        rank = np.arange(len(frame)) - np.searchsorted(frame, frame)
        return take(self, order[rank < count])

    def of(self, frames: Int[np.ndarray, " some"]) -> "Pool":
        """Those of some frames."""
        return take(self, np.isin(self.frame, frames))

    def rows(self, frames: Int[np.ndarray, " some"], count: int) -> Hypotheses:
        """So many of each of some frames, the cheapest first; where there are fewer, the dearest stands in again."""
        best = self.of(frames).cheapest(count)
        start = np.searchsorted(best.frame, frames)
        there = np.searchsorted(best.frame, frames, "right") - start
        chosen = start[:, None] + np.minimum(np.arange(count)[None], there[:, None] - 1)
        return Hypotheses(take(best.poses, chosen), best.cost[chosen])


def pool_of(poses: Pose, frames: Int[np.ndarray, " some"]) -> Pool:
    """The poses (axes ``some hypotheses``) of some frames, their costs not known yet."""
    count = poses.root.shape[1]
    flat = jax.tree.map(lambda a: np.asarray(a, np.float32).reshape(-1, *a.shape[2:]), poses)
    return Pool(np.repeat(frames, count), flat, np.full(len(frames) * count, np.inf, np.float32))


def select_distinct(
    pool: Pool,
    margin: float,
    count: int,
    segments: Int[np.ndarray, " segments"] = _ALL,
    known: Pool | None = None,
) -> Bool[np.ndarray, " n"]:
    """Which hypotheses of a pool are worth more work.

    Of poses that are alike only the cheapest goes on, as long as it costs no more than the cheapest of the frame and a
    margin, and at most so many of a frame.

    Args:
        pool: To choose from.
        margin: In the units of the costs.
        count: The most of each frame.
        segments: What poses are alike in.
        known: Hypotheses that are there already: with these all are compared.
    """
    every = pool if known is None else known.joined(pool)
    new = np.arange(len(every)) >= len(every) - len(pool)
    order = np.lexsort((every.cost, every.frame))
    frames, starts, counts = np.unique(every.frame[order], return_index=True, return_counts=True)
    roots, rotations = every.poses.root, every.poses.rotations[:, segments]
    chosen = np.zeros(len(every), bool)
    compared = np.full((len(frames), int(counts.max(initial=0))), -1)  # those that are like no cheaper one
    taken_on = np.zeros(len(frames), int)
    for rank in range(compared.shape[1]):
        row = np.flatnonzero(counts > rank)
        member = order[starts[row] + rank]
        near = every.cost[member] <= every.cost[order[starts[row]]] + margin
        other = compared[row, :rank]
        apart = np.linalg.norm(roots[other] - roots[member, None], axis=-1) < _APART
        turned = np.abs(rotations[other] - rotations[member, None]).max((2, 3, 4)) < _TURNED
        fresh = ~((other >= 0) & apart & turned).any(1)
        compared[row[fresh], rank] = member[fresh]
        go = near & fresh & new[member] & (taken_on[row] < count)
        chosen[member[go]] = True
        taken_on[row] += go
    return chosen[new]
