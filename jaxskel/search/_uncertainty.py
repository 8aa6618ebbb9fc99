"""How far the joints of a searched pose may be off: covariances, and the probability of being right."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from .._math.gaussians import probability_within
from ..body import JOINT_NAMES, without_side
from ._unexplained import trust_in_explained

# Standard deviation of each joint as a share of what the normal equations of `volume_objective` say, and what remains
# of it (m) however well outlines show a limb: where along it the joint lies.
_SHARES = {
    "pelvis": 0.47, "neck": 0.43, "head": 0.35, "shoulder": 0.3, "elbow": 0.18, "hand": 0.22, "hip": 0.36, "knee": 0.3,
    "foot": 0.17,
}  # fmt: skip
_LEAST = dict.fromkeys(_SHARES, 0.0) | {"elbow": 0.004, "hand": 0.01}
# What the normal equations say (m) from which on they say too little: a limb that hardly any outline touches may be
# elsewhere altogether. And the deviation that it has at most, because it is where people usually hold it: hands that
# nothing shows were 60 mm off along each axis. Without this limit, they were given as much as 600 mm.
_UNSEEN, _POWER = 0.05, 6
_HARDLY_SEEN = 0.1
# Largest deviation (m): a joint that nothing shows is nevertheless a part of a body that something shows.
_FARTHEST = 1.0
# In units of `volume_objective`: excess over the best cost that divides a rival's weight by e, and excess of the best
# cost over the threshold that doubles the deviations.
_RIVAL_COST, _EXCESS_COST = 0.7, 5.0
# The first of these for a rival that faces the other way, as a share of the cost threshold: the less a body explains,
# the less its cost tells front from back. The costs of 30 frames of a child in wide clothes, who was turned round in 8
# of them, are likeliest with this.
_TURNED_SHARE = 0.1
# Doublings of the deviations at most by a high cost, and by outlines that something other than the subject causes.
_DOUBLINGS, _UNEXPLAINED = 5.0, 4.0
# Cost threshold above which no body explains what is in most silhouettes, and doublings of the deviations for each
# doubling of it. Thresholds are 12 to 20 for naked people, to 33 in clothes, 48 for a child in wide clothes with a
# rope, 120 for a man on a chair.
_NO_BODY, _DOUBLINGS_BEYOND = 55.0, 2.0
# Thickness of clothes (m) that makes the variance of joints twice that of naked people, and costs tell half as much.
_TWICE_AS_VAGUE = 0.035
# Standard deviation of each joint as a share of the thickness of what is worn around it: so that the truth is within
# two and three deviations as often as it should be (crowd p00 to p07, seeds 4 and 5 of the clothes).
_HIDDEN = {
    "pelvis": 0.9, "neck": 0.5, "head": 0.9, "shoulder": 0.4, "elbow": 0.6, "hand": 0.15, "hip": 0.6, "knee": 0.45,
    "foot": 0.15,
}  # fmt: skip
# Joints closer than this are in the same place (m), as in the paper's Table 1.
SAME_PLACE = 0.1


def _of_joints(of: dict[str, float]) -> Float[np.ndarray, "joints=15"]:
    return np.array([of[without_side(name)] for name in JOINT_NAMES])


_SHARE_OF_JOINT, _LEAST_OF_JOINT, _HIDDEN_OF_JOINT = _of_joints(_SHARES), _of_joints(_LEAST), _of_joints(_HIDDEN)


class Uncertainty(NamedTuple):
    """How far joints may be off.

    Attributes:
        covariance: Of each joint about where it is given (m^2).
        confidence: Probability that it is within 100 mm of the truth.
        facing: Confidence that the person does not face the other way, so that left and right are exchanged (0.5..1).
    """

    covariance: Float[np.ndarray, "frames joints 3 3"]
    confidence: Float[np.ndarray, "frames joints"]
    facing: Float[np.ndarray, " frames"]


def prior_in_clothes(clothes: float) -> float:
    """How many times as much priors of poses count: costs tell less in clothes of that thickness (m).

    The root of how much less: with all of it, priors decided more than they should in clothes of 6 to 8 cm. Of 128
    hands of the tuning half in coats, 23 and 25 were wrong, 31 with the same weight for everybody, 38 without a prior.
    """
    return float(np.sqrt(variance_in_clothes(clothes, _TWICE_AS_VAGUE)))


def variance_in_clothes(clothes: float, doubled: float) -> float:
    """How many times larger a variance is than of naked people.

    Args:
        clothes: Root mean square thickness of what the subject wears (m).
        doubled: Thickness at which it is twice as large (m).
    """
    return 1.0 + (clothes / doubled) ** 2


def searched_uncertainty(
    away: Float[np.ndarray, "frames hypotheses joints 3"],
    cost: Float[np.ndarray, "frames hypotheses"],
    covariance: Float[np.ndarray, "frames joints 3 3"],
    cost_threshold: float,
    unexplained: Float[np.ndarray, " frames"],
    clothes: float = 0.0,
    worn: Float[np.ndarray, " joints"] | float = 0.0,
    turned: Bool[np.ndarray, "frames hypotheses"] | bool = False,
) -> Uncertainty:
    """Uncertainty of the cheapest hypothesis: its own, and that of choosing it among its rivals.

    Args:
        away: Joints of all hypotheses, relative to those of the cheapest (m, in the world); no two hypotheses of a
            frame are alike.
        cost: Costs of all hypotheses.
        covariance: Covariances from the normal equations, see `joint_covariance`.
        cost_threshold: Cost that few frames of this subject exceed, see `cost_threshold` in `_search`.
        unexplained: Share of the outlines that the pose leaves unexplained.
        clothes: Root mean square thickness of what the subject wears (m).
        worn: The same of what is worn around each joint (m).
        turned: Which hypotheses face another way than the cheapest.
    """
    raw = np.maximum(np.sqrt(np.trace(covariance, axis1=-2, axis2=-1, dtype=np.float64) / 3), 1e-9)
    loose = variance_in_clothes(clothes, _TWICE_AS_VAGUE)
    remains = np.hypot(_HIDDEN_OF_JOINT * worn, _LEAST_OF_JOINT)
    doublings = np.clip((cost[:, 0] - cost_threshold) / _EXCESS_COST, 0.0, _DOUBLINGS)
    doublings += _DOUBLINGS_BEYOND * max(np.log2(cost_threshold / _NO_BODY), 0.0)
    doublings += _UNEXPLAINED * (1 - trust_in_explained(unexplained))
    deviation = np.sqrt(loose) * _SHARE_OF_JOINT * raw * (1 + (raw / _UNSEEN) ** _POWER)
    deviation = _HARDLY_SEEN / np.hypot(_HARDLY_SEEN / deviation, 1.0)
    deviation = np.minimum(deviation * 2 ** doublings[:, None], _FARTHEST)
    own = covariance * ((deviation / raw) ** 2)[..., None, None] + (remains**2)[:, None, None] * np.eye(3)
    usual = _RIVAL_COST * loose
    scale = np.where(turned, max(_TURNED_SHARE * cost_threshold, usual), usual)
    weight = np.exp(-np.clip(cost - cost[:, :1], -50.0, None) / scale)
    weight = weight / weight.sum(1, keepdims=True)
    facing = np.clip((weight * ~np.broadcast_to(turned, weight.shape)).sum(1), 0.5, 1.0)
    weight = weight[..., None]
    between = np.einsum("fkj,fkja,fkjb->fjab", np.broadcast_to(weight, away.shape[:3]), away, away)
    offset, spread = np.linalg.norm(away, axis=-1), np.hypot(deviation, remains)[:, None]
    right = (weight * probability_within(SAME_PLACE, offset, np.broadcast_to(spread, offset.shape))).sum(1)
    # Weights add up to one but for rounding.
    right = np.clip(right, 0.0, 1.0)
    return Uncertainty(*(told.astype(np.float32) for told in (own + between, right, facing)))
