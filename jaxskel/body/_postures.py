"""Postures of the template that other conventions start from: hanging arms (anatomy), and a T-pose (animation).

A posture is the rotation of each segment from the template's rest. Trunk and head stay as they are at rest.
"""

import numpy as np
from jaxtyping import Float

from .._math.rotations import aligning, frame
from .._math.vectors import unit
from ._human import JOINT_NAMES, PIVOT_NAMES, SEGMENT_NAMES, TIP_NAMES
from ._skeleton import Skeleton

_FRONT, _LEFT, _UP = np.eye(3)
# A foot that reaches less far ahead at rest (m) has no direction.
_AHEAD = 0.005


def neutral_posture(skeleton: Skeleton) -> Float[np.ndarray, "segments=17 3 3"]:
    """Standing straight with hanging arms: the zero of joint angles.

    Upper arms and thighs point straight down; hinges of elbows and knees point to the left and right. Forearms, hands
    and shanks point down as nearly as turning about the hinge can; feet point ahead, and are as flat as at rest.
    """
    return _posture(skeleton, {"l_": -_UP, "r_": -_UP})


def t_posture(skeleton: Skeleton) -> Float[np.ndarray, "segments=17 3 3"]:
    """Standing straight with the arms to the sides: how animation programs expect a body at rest.

    Hinges of elbows point up or down and those of knees to the left, so that a limb which bends as a hinge does so
    about one axis. A bone beyond may go sideways by a degree or two, as shanks do.
    """
    return _posture(skeleton, {"l_": _LEFT, "r_": -_LEFT})


def _posture(skeleton: Skeleton, arms: dict[str, Float[np.ndarray, "3"]]) -> Float[np.ndarray, "segments=17 3 3"]:
    """Legs down, feet ahead, and arms where they are told to point to."""
    points = np.concatenate([skeleton.rest_joints, skeleton.rest_tips, skeleton.pivots]).astype(np.float64)
    at: dict[str, Float[np.ndarray, 3]] = dict(zip(JOINT_NAMES + TIP_NAMES + PIVOT_NAMES, points, strict=True))
    turns = {name: np.eye(3) for name in SEGMENT_NAMES}
    for side, out in arms.items():
        arm, leg = (
            [at[side + point] for point in chain] for chain in (("shoulder", "elbow", "hand"), ("hip", "knee", "ankle"))
        )
        turns[side + "upper_arm"], turns[side + "forearm"] = _straightened(arm, out, _FRONT)
        # The wrist is on the line from elbow to palm.
        turns[side + "hand"] = turns[side + "forearm"]
        turns[side + "thigh"], turns[side + "shank"] = _straightened(leg, -_UP, -_FRONT)
        ahead = (at[side + "toetip"] - at[side + "ankle"]) * [1.0, 1.0, 0.0]
        if np.linalg.norm(ahead) > _AHEAD:
            turns[side + "foot"] = frame(_UP, np.cross(_UP, ahead)).T
    return np.stack([turns[name] for name in SEGMENT_NAMES])


def _straightened(
    points: list[Float[np.ndarray, "3"]], way: Float[np.ndarray, "3"], bends: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3 3"]]:
    """Rotations that lay the first bone along `way`, and the second one as nearly as turning about the hinge can.

    Args:
        points: Ends of two consecutive bones at rest (m).
        way: Unit vector.
        bends: Unit vector perpendicular to it: where the limb bends to, as in `hinge_axes`.
    """
    first, second = (unit(end - start) for start, end in zip(points[:-1], points[1:], strict=True))
    hinge = np.cross(way, bends)
    upper = aligning(first, way)
    upper = aligning(unit(upper @ np.cross(first, bends)), hinge) @ upper
    bone = upper @ second
    return upper, aligning(unit(bone - hinge * (hinge @ bone)), way) @ upper
