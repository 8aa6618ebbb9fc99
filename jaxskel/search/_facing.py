"""Which way a body faces, and the rival that faces the other way: front and back may look alike in wide clothes."""

import jax
import numpy as np
from jaxtyping import Array, Bool, Float

from .._runtime.batching import take
from ..body import SEGMENT_NAMES, Pose, Skeleton
from ._hypotheses import Hypotheses, Pool
from ._start_poses import other_ways

# The segments that tell which way a body faces, and their axis that points to the left.
_TRUNK, _LEFT = [SEGMENT_NAMES.index(name) for name in ("pelvis", "chest")], 1
# Of the eight poses of `other_ways`, those that face the opposite way, with the feet straight and crossed.
_OPPOSITE = slice(2, 4)


def left_of(poses: Pose) -> Float[Array | np.ndarray, "*poses 3"]:
    """Direction in which the left side of a body lies, twice as long as a unit vector where it is not twisted."""
    return poses.rotations[..., _LEFT][..., _TRUNK, :].sum(-2)


def turned_round(
    left: Float[Array | np.ndarray, "*#poses 3"], other: Float[Array | np.ndarray, "*#poses 3"]
) -> Bool[Array | np.ndarray, "*poses"]:
    """Whether two bodies face opposite ways, from the directions of their left sides."""
    return (left * other).sum(-1) < 0


def angles_between(
    left: Float[np.ndarray, "*#poses 3"], other: Float[np.ndarray, "*#poses 3"]
) -> Float[np.ndarray, "*poses"]:
    """Angles by which bodies are turned against others (rad), from the directions of their left sides."""
    lengths = np.linalg.norm(left, axis=-1) * np.linalg.norm(other, axis=-1)
    return np.arccos(np.clip((left * other).sum(-1) / np.maximum(lengths, 1e-9), -1.0, 1.0))


def turned_rivals(found: Hypotheses) -> Bool[np.ndarray, "frames hypotheses"]:
    """Which hypotheses face another way than the cheapest of their frame."""
    left = left_of(found.poses)
    return np.asarray(turned_round(left, left[:, :1]))


def cheapest_each_way(pool: Pool) -> Pool:
    """The cheapest hypothesis of each frame, and the cheapest that faces the other way, if there is one."""
    best = pool.cheapest(1)
    return best.joined(take(pool, _away_from(best, pool)).cheapest(1))


def turned_starts(joints: Float[np.ndarray, "frames joints 3"], skeleton: Skeleton) -> Pose:
    """Two poses a frame that face the other way than a pose with these joints (m), with arms at rest."""
    return jax.tree.map(lambda a: a[:, _OPPOSITE], other_ways(joints, skeleton))


def both_ways(pool: Pool, count: int) -> Pool:
    """At most `count` hypotheses of each frame: the cheapest ones, and the cheapest that faces the other way.

    Of poses that are alike there is only one, as in `Pool.distinct`.
    """
    kept = pool.distinct(count)
    best = kept.cheapest(1)
    rivals = take(pool, _away_from(best, pool)).cheapest(1)
    left_out = take(rivals, ~np.isin(rivals.frame, kept.frame[_away_from(best, kept)]))
    full = np.isin(kept.frame, left_out.frame)
    others = take(kept, ~full).joined(take(kept, full).cheapest(count - 1))
    return others.joined(left_out).cheapest(count)


def _away_from(best: Pool, pool: Pool) -> Bool[np.ndarray, " n"]:
    """Whether each of a pool faces another way than the best of its frame; `best` has one for each frame."""
    lefts = left_of(best.poses)[np.searchsorted(best.frame, pool.frame)]
    return np.asarray(turned_round(left_of(pool.poses), lefts))
