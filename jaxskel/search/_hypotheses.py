"""Pose hypotheses and their costs: `Pool` (any number per frame) during the search, `Hypotheses` at its end."""

from dataclasses import dataclass

import jax
import numpy as np
from jax.tree_util import register_dataclass
from jaxtyping import Bool, Float, Int

from .._runtime.batching import take
from ..body import SEGMENT_NAMES, Pose

# Two poses are alike if their roots are closer than _APART (m) and no entry of a rotation differs by more than _TURNED.
_APART, _TURNED = 0.02, 0.1
_ALL = np.arange(len(SEGMENT_NAMES))


@register_dataclass
@dataclass(frozen=True, eq=False)
class Hypotheses:
    """Poses of some frames, the same number for each, the cheapest first; costs are those of `volume_objective`.

    Attributes:
        poses: Axes ``frames hypotheses``.
    """

    poses: Pose
    cost: Float[np.ndarray, "frames hypotheses"]

    @property
    def best(self) -> Pose:
        """The cheapest pose of each frame, without the axis of hypotheses."""
        return jax.tree.map(lambda a: a[:, 0], self.poses)

    def ordered(self, order: Int[np.ndarray, "frames some"]) -> "Hypotheses":
        """Select hypotheses of each frame by index, in the given order."""
        rows = np.arange(len(order))[:, None]
        return jax.tree.map(lambda a: a[rows, order], self)

    def joined(self, others: "Hypotheses") -> "Hypotheses":
        """The hypotheses of both, in this order."""
        return jax.tree.map(lambda a, b: np.concatenate([a, b], 1), self, others)

    def pool(self, frames: Int[np.ndarray, " some"]) -> "Pool":
        """Those that there are, as a pool; `frames` are the frames' indices in the stack."""
        poses = pool_of(self.poses, frames)
        return take(Pool(poses.frame, poses.poses, self.cost.ravel()), np.isfinite(self.cost).ravel())

    def replaced(self, frames: Int[np.ndarray, " some"], others: "Hypotheses") -> "Hypotheses":
        """The same with those of some frames replaced."""

        def put(own: np.ndarray, other: np.ndarray) -> np.ndarray:
            own = np.array(own)
            own[frames] = other
            return own

        return jax.tree.map(put, self, others)


@register_dataclass
@dataclass(frozen=True, eq=False)
class Pool:
    """Poses of the frames of a stack, any number for each frame.

    Attributes:
        frame: Index of the frame that each pose belongs to.
        poses: Axis ``n``.
        cost: Cost of each pose; infinite until it is computed.
    """

    frame: Int[np.ndarray, " n"]
    poses: Pose
    cost: Float[np.ndarray, " n"]

    def __len__(self) -> int:
        return len(self.frame)

    def joined(self, other: "Pool") -> "Pool":
        """The hypotheses of both pools."""
        return jax.tree.map(lambda a, b: np.concatenate([a, b]), self, other)

    def cheapest(self, count: int) -> "Pool":
        """At most `count` hypotheses of each frame, sorted by frame and then by cost."""
        order = np.lexsort((self.cost, self.frame))
        frame = self.frame[order]
        rank = np.arange(len(frame)) - np.searchsorted(frame, frame)
        return take(self, order[rank < count])

    def distinct(self, count: int) -> "Pool":
        """At most `count` hypotheses of each frame, of which no two are alike, sorted by frame and then by cost."""
        return take(self, select_distinct(self, np.inf, count)).cheapest(count)

    def of(self, frames: Int[np.ndarray, " some"]) -> "Pool":
        """The hypotheses of some frames."""
        return take(self, np.isin(self.frame, frames))

    def rows(self, frames: Int[np.ndarray, " some"], count: int) -> Hypotheses:
        """The `count` cheapest of each of some frames; where there are fewer, the last is repeated at infinite cost."""
        best = self.of(frames).cheapest(count)
        start = np.searchsorted(best.frame, frames)
        there = np.searchsorted(best.frame, frames, "right") - start
        rank = np.arange(count)[None]
        chosen = start[:, None] + np.minimum(rank, there[:, None] - 1)
        return Hypotheses(take(best.poses, chosen), np.where(rank < there[:, None], best.cost[chosen], np.inf))


def pool_of(poses: Pose, frames: Int[np.ndarray, " some"]) -> Pool:
    """Make a pool of poses (axes ``some hypotheses``) of some frames, with costs not computed yet."""
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

    Of poses that are alike only the cheapest is chosen, if it costs at most `margin` more than the cheapest of its
    frame; at most `count` for each frame.

    Args:
        pool: Hypotheses to choose from.
        margin: Largest excess over the cheapest of the frame, in units of cost.
        count: Largest number for each frame.
        segments: Segments whose rotations are compared.
        known: Hypotheses fitted before: the pool is compared with them too, but none of them is chosen.
    """
    every = pool if known is None else known.joined(pool)
    new = np.arange(len(every)) >= len(every) - len(pool)
    order = np.lexsort((every.cost, every.frame))
    frames, starts, counts = np.unique(every.frame[order], return_index=True, return_counts=True)
    roots, rotations = every.poses.root, every.poses.rotations[:, segments]
    chosen = np.zeros(len(every), bool)
    compared = np.full((len(frames), int(counts.max(initial=0))), -1)  # those unlike every cheaper one
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
