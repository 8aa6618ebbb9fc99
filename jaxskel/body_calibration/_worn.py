"""What a subject wears around each joint: by how much its body is thicker there than naked people are."""

import numpy as np
from jaxtyping import Float

from ..body import (
    BALL_NAMES,
    FREE_BALLS,
    JOINT_NAMES,
    QUANTITIES,
    Body,
    flesh_prior,
    measured_body,
    without_side,
)
from ._clothing import FLESH_DEVIATIONS

# Balls whose clothes hide where a joint is. Names omit l_ and r_.
_AROUND = {
    "pelvis": ("seat", "waist", "hip"), "neck": ("chest", "girdle", "nape"), "head": ("nape", "face", "crown"),
    "shoulder": ("chest", "girdle", "shoulder"), "elbow": ("shoulder", "elbow", "forearm"),
    "hand": ("elbow", "forearm", "wrist"), "hip": ("seat", "hip"), "knee": ("hip", "knee", "calf"),
    "foot": ("calf", "hem", "ankle"),
}  # fmt: skip


def _mean_around() -> Float[np.ndarray, "joints=15 balls"]:
    balls = [without_side(BALL_NAMES[ball]) for ball in FREE_BALLS]
    around = np.array([[ball in _AROUND[without_side(joint)] for ball in balls] for joint in JOINT_NAMES], float)
    return around / around.sum(1, keepdims=True)


_MEAN_AROUND = _mean_around()
_RADII = np.array([QUANTITIES.index(f"{without_side(BALL_NAMES[ball])} radius") for ball in FREE_BALLS])


def worn_around_joints(body: Body) -> Float[np.ndarray, "joints=15"]:
    """Root mean square thickness of what is worn around each joint (m), in the order of `JOINT_NAMES`.

    A body wears something where it is thicker than the flesh of naked people with its skeleton, by more than two
    standard deviations; their variance is subtracted.

    Args:
        body: A body as [`make_body`][] makes it, symmetric (m).
    """
    naked = flesh_prior(body.skeleton)
    flesh = np.linalg.inv(naked.precision).diagonal()[_RADII]
    usual = np.asarray(measured_body(body.skeleton, naked.mean).radii)
    thicker = np.maximum(np.asarray(body.radii) - usual, 0.0)[list(FREE_BALLS)]
    return np.sqrt(_MEAN_AROUND @ np.maximum(thicker**2 - FLESH_DEVIATIONS**2 * flesh, 0.0))
