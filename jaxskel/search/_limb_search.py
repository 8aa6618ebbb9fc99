"""Search for arms and legs in the hull: score every pose of a table and return the cheapest that differ.

Where an arm lies on the trunk, no graph path leads to its hand, and a fit from a wrong start stays wrong. But an arm
must lie inside the hull and outside the trunk, and must explain outlines that the rest of the body leaves unexplained.
A table of a few thousand poses is tested against these conditions quickly.

All functions are for one frame, to be vmapped. Costs are those of the objective's terms that can score limbs.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._math.vectors import unit
from ..body import (
    BALL_NAMES,
    LINKS,
    SEGMENT_NAMES,
    Body,
    Pose,
    Skeleton,
    capsule_ends,
    limb_capsules,
    nearest_to_rays,
)
from ..outlines import Contours
from ..refinement.terms import AbstractTerm, Objective, Observed, place
from ._limb_tables import LimbTable, arm_table, leg_table

# How many poses of the table pass each stage: upper bone inside the hull; whole limb inside the hull and outside the
# trunk; cheapest with the unexplained outlines.
_INSIDE, _OUTSIDE, _BEST = 1600, 400, 64
# Number of unexplained rays that the poses are scored on.
_RAYS = 256
# A ray closer than this to the rest of the body is explained (m).
_EXPLAINED = 0.012
# Two poses of a limb are the same if middle joint and end are closer than this (m).
_APART = 0.12


class Limb(eqx.Module):
    """A limb and its table of poses. What differs between left and right is data, so that one program serves both.

    Attributes:
        kind: ``arm`` or ``leg``.
        segments: Chest or pelvis, upper bone, lower bone, hand or foot.
        balls: From shoulder or hip to palm or ball of the foot.
        costs: Cost of each pose of the table, whatever the frame shows.
    """

    kind: str = eqx.field(static=True)
    table: LimbTable
    segments: Int[Array | np.ndarray, "parts=4"]
    balls: Int[Array | np.ndarray, "points=5"]
    costs: Float[Array | np.ndarray, " poses"]


class Scored(eqx.Module):
    """The cheapest poses of one limb.

    Attributes:
        index: Rows of the table.
        cost: Cost of lying outside the hull or inside the trunk.
        left: Remaining cost of each unexplained ray.
        joints: Middle joint and end of the limb, relative to shoulder or hip (m, world axes).
    """

    index: Int[Array, " best"]
    cost: Float[Array, " best"]
    left: Float[Array, "best rays"]
    joints: Float[Array, "best 2 3"]


_SEGMENTS = {
    "arm": ("chest", "upper_arm", "forearm", "hand"),
    "leg": ("pelvis", "thigh", "shank", "foot"),
}
_BALLS = {
    "arm": ("shoulder", "elbow", "forearm", "wrist", "palm"),
    "leg": ("hip", "knee", "calf", "ankle", "ball"),
}


def make_limb(skeleton: Skeleton, name: str, objective: Objective) -> Limb:
    """The limb with a name such as ``l_arm``, for a search that minimises an objective."""
    side, kind = name[:2], name[2:]
    table = {"arm": arm_table, "leg": leg_table}[kind](skeleton, side[0])
    first, *rest = _SEGMENTS[kind]
    segments = [SEGMENT_NAMES.index(segment) for segment in (first, *(side + part for part in rest))]
    balls = [BALL_NAMES.index(side + ball) for ball in _BALLS[kind]]
    costs = _posture_costs(objective, kind, table, 1.0 if side == "l_" else -1.0)
    return Limb(kind, table, np.array(segments, np.int32), np.array(balls, np.int32), costs)


def _posture_costs(objective: Objective, kind: str, table: LimbTable, side: float) -> Float[np.ndarray, " poses"]:
    middles, ends = np.asarray(table.upper_points)[table.direction, 1], np.asarray(table.lower_points)[:, 2]
    bones = (bone * [1.0, side, 1.0] for bone in (middles, ends - middles))
    directions = np.concatenate([unit(bone) for bone in bones], 1)
    terms = [term for term in objective.of_frames.values() if float(term.weight)]
    found = ((term.weight, term.posture_costs(kind, directions)) for term in terms)
    each = [float(weight) * costs for weight, costs in found if costs is not None]
    return sum(each, np.zeros(len(directions))).astype(np.float32)


def without(*limbs: str) -> Int[np.ndarray, " capsules"]:
    """Capsules of the body without some limbs."""
    return np.flatnonzero(~limb_capsules(*limbs)).astype(np.int32)


def unexplained(
    body: Body,
    pose: Pose,
    objective: Objective,
    observed: Observed,
    capsules: Int[Array | np.ndarray, " capsules"],
) -> tuple[Contours, Float[Array, " rays"]]:
    """The outline rays that some capsules of the body leave unexplained, and the cost of each.

    Their number is fixed; it is filled up with explained rays of zero cost.
    """
    assert observed.contours is not None
    centres, directions = jnp.asarray(observed.contours.centres), jnp.asarray(observed.contours.directions)
    placed = place(body.skeleton, pose)
    ends, radii = _capsules(body, capsule_ends(body, placed.origins, placed.rotations), capsules)
    distance, chosen = jax.lax.top_k(nearest_to_rays(centres, directions, ends, radii).distance, _RAYS)
    each = _summed(objective, distance, lambda term: term.ray_costs(distance, observed))
    return Contours(centres[chosen], directions[chosen]), jnp.where(distance > _EXPLAINED, each, 0.0)


def score_limb(
    body: Body,
    pose: Pose,
    objective: Objective,
    observed: Observed,
    limb: Limb,
    unexplained: Contours,
    costs: Float[Array, " rays"],
) -> Scored:
    """Score the poses of one limb's table by hull, trunk and unexplained outlines."""
    placed = place(body.skeleton, pose)
    parent, upper = limb.segments[0], limb.segments[1]
    origin, turned = placed.origins[upper], placed.rotations[parent]
    radii = _radii(body, limb)
    directions, uppers, lowers = (
        jnp.asarray(a) for a in (limb.table.direction, limb.table.upper_points, limb.table.lower_points)
    )
    uppers = origin[None, None] + uppers @ turned.T

    def outside(points: Float[Array, "poses points 3"], radii: Float[Array, " points"]) -> Float[Array, " poses"]:
        balls = points.reshape(-1, 3), jnp.tile(radii, len(points))
        found = _summed(objective, balls[1], lambda term: term.ball_costs(*balls, observed))
        return found.reshape(len(points), -1).sum(1)

    # The upper bone has few directions: poses whose upper bone leaves the hull are dropped before the rest is scored.
    upper_cost, index = _cheapest(outside(uppers, radii[:2])[directions], _INSIDE)
    lowers = origin[None, None] + lowers[index] @ turned.T
    uppers = uppers[directions[index]]
    cost = upper_cost + outside(lowers, radii[2:]) + jnp.asarray(limb.costs)[index]
    if limb.kind == "arm":
        ends, capsule_radii = _capsules(body, capsule_ends(body, placed.origins, placed.rotations), _TRUNK_AND_LEGS)
        low = jnp.concatenate([uppers[:, 1:], lowers], 1)
        balls = low.reshape(-1, 3), jnp.tile(radii[1:], len(low))
        deep = _summed(objective, balls[1], lambda term: term.collision_costs(*balls, ends, capsule_radii))
        cost = cost + deep.reshape(len(low), -1).sum(1)
    cost, best = _cheapest(cost, _OUTSIDE)
    index, chosen = index[best], jnp.concatenate([uppers[best], lowers[best]], 1)
    tip = chosen[:, 4] + 0.5 * (chosen[:, 4] - chosen[:, 3])
    starts = jnp.stack([jnp.broadcast_to(origin, tip.shape), chosen[:, 1], chosen[:, 3]], 1)
    stops = jnp.stack([chosen[:, 1], chosen[:, 3], tip], 1)
    capsules = jnp.stack([starts, stops], 2)  # poses x 3 x 2 x 3
    capsule_radii = jnp.stack([radii[0], radii[0], radii[1], radii[3], radii[4], radii[4]]).reshape(3, 2)
    rays = jnp.asarray(unexplained.centres), jnp.asarray(unexplained.directions)
    distance = jax.vmap(lambda ends: nearest_to_rays(*rays, ends, capsule_radii).distance)(capsules)
    distance = jnp.maximum(distance, 0.0)
    left = jnp.minimum(costs[None], _summed(objective, distance, lambda term: term.ray_costs(distance, observed)))
    _, best = _cheapest(cost + left.sum(1), _BEST)
    joints = chosen[best][:, np.array([1, 4], np.int32)] - origin[None, None]
    return Scored(index[best], cost[best], left[best], joints)


def best_pairs(left: Scored, right: Scored, count: int) -> tuple[Int[Array, " count"], Int[Array, " count"]]:
    """The cheapest pairs of poses of two limbs that differ from each other, as rows of the two tables."""
    total = jax.vmap(
        lambda cost, points: cost + right.cost + jnp.minimum(points[None], right.left).sum(1)
    )(left.cost, left.left)  # fmt: skip
    near_left, near_right = _near(left), _near(right)

    def pick(total: Array, _: None) -> tuple[Array, tuple[Array, Array]]:
        first, second = jnp.unravel_index(jnp.argmin(total), total.shape)
        same = near_left[first][:, None] & near_right[second][None]
        return jnp.where(same, jnp.inf, total), (left.index[first], right.index[second])

    return jax.lax.scan(pick, total, None, length=count)[1]


def none_scored(costs: Float[Array, " rays"]) -> Scored:
    """Scores of a limb that stays as it is: its first row costs nothing and explains no ray, others are out."""
    free = jnp.arange(_BEST, dtype=jnp.int32) == 0
    return Scored(
        jnp.zeros(_BEST, jnp.int32),
        jnp.where(free, 0.0, jnp.inf).astype(costs.dtype),
        jnp.broadcast_to(costs, (_BEST, len(costs))),
        jnp.zeros((_BEST, 2, 3), costs.dtype),
    )


def with_limb(pose: Pose, limb: Limb, index: Int[Array, ""]) -> Pose:
    """The pose with one limb replaced by a row of its table."""
    parent, upper, lower, end = jnp.asarray(limb.segments)
    rotations = jnp.asarray(pose.rotations)
    turned = rotations[parent]
    new_upper, new_lower = (turned @ jnp.asarray(of)[index] for of in (limb.table.upper, limb.table.lower))
    segment = jnp.arange(len(rotations), dtype=jnp.int32)[:, None, None]
    rotations = jnp.where(segment == upper, new_upper[None], rotations)
    return Pose(pose.root, jnp.where((segment == lower) | (segment == end), new_lower[None], rotations))


def _near(scored: Scored) -> Bool[Array, "best best"]:
    apart = scored.joints[:, None] - scored.joints[None]
    return (apart**2).sum(-1).max(-1) < _APART**2


def _cheapest(cost: Float[Array, " n"], count: int) -> tuple[Float[Array, " count"], Int[Array, " count"]]:
    value, index = jax.lax.top_k(-cost, min(count, len(cost)))
    return -value, index


def _radii(body: Body, limb: Limb) -> Float[Array, "points=5"]:
    """Radii (m) of the five points of a table: two on the upper bone, three on the lower one."""
    radii = jnp.asarray(body.radii)[jnp.asarray(limb.balls)]
    return radii.at[0].set((radii[0] + radii[1]) / 2)


# Capsules of the shoulder girdle may overlap the upper arm.
_GIRDLE = np.array([any(BALL_NAMES[ball].endswith("girdle") for ball in pair) for pair in LINKS])
_TRUNK_AND_LEGS = np.flatnonzero(~limb_capsules("l_arm", "r_arm") & ~_GIRDLE).astype(np.int32)


def _capsules(
    body: Body, ends: Array | np.ndarray, chosen: Int[Array | np.ndarray, " capsules"]
) -> tuple[Array, Array]:
    """Ends (m) and radii (m) of some of the body's capsules."""
    chosen = jnp.asarray(chosen)
    return jnp.asarray(ends)[chosen], jnp.asarray(body.radii)[jnp.asarray(body.links)[chosen]]


def scores_limbs(objective: Objective) -> bool:
    """Whether any term can score the poses of a table by themselves."""
    own = "ball_costs", "ray_costs"
    terms = objective.of_frames.values()
    return any(getattr(type(term), name) is not getattr(AbstractTerm, name) for term in terms for name in own)


def _summed(
    objective: Objective, like: Float[Array, "*each"], costs_of: Callable[[AbstractTerm], Float[Array, "*each"] | None]
) -> Float[Array, "*each"]:
    """Weighted costs of all terms that have such costs."""
    found = ((term.weight, costs_of(term)) for term in objective.of_frames.values())
    return sum((weight * costs for weight, costs in found if costs is not None), jnp.zeros_like(like))
