"""An animation skeleton: rotating joints with constant offsets, at rest in a T-pose.

At rest x is to the front, y to the left, z up.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..._math.rotations import aligning, frame
from ..._math.vectors import unit
from ...body import JOINT_NAMES, PIVOT_NAMES, SEGMENT_NAMES, TIP_NAMES, Pose, Skeleton

# Each joint: its name, its parent's name, its point, and the segment with which it rotates. The trunk rotates apart
# from the pelvis, which holds the hips, and each collar bone by itself, so these joints coincide with their parents.
_TRUNK = (
    ("Hips", "", "pelvis", "pelvis"), ("Spine", "Hips", "pelvis", "chest"), ("Neck", "Spine", "neck", "head"),
    ("Head", "Neck", "head", "head"), ("HeadTop", "Head", "head_top", "head"),
)  # fmt: skip
_ARM = (
    ("{}Shoulder", "Spine", "neck", "{}clavicle"), ("{}Arm", "{}Shoulder", "{}shoulder", "{}upper_arm"),
    ("{}ForeArm", "{}Arm", "{}elbow", "{}forearm"), ("{}Hand", "{}ForeArm", "{}wrist", "{}hand"),
    ("{}Palm", "{}Hand", "{}hand", "{}hand"), ("{}Fingertip", "{}Palm", "{}fingertip", "{}hand"),
)  # fmt: skip
_LEG = (
    ("{}UpLeg", "Hips", "{}hip", "{}thigh"), ("{}Leg", "{}UpLeg", "{}knee", "{}shank"),
    ("{}Foot", "{}Leg", "{}ankle", "{}foot"), ("{}ToeBase", "{}Foot", "{}foot", "{}foot"),
    ("{}Toetip", "{}ToeBase", "{}toetip", "{}foot"),
)  # fmt: skip
_SIDES = (("Left", "l_"), ("Right", "r_"))
RIG = _TRUNK + tuple(
    (name.format(side), parent.format(side), point.format(letter), segment.format(letter))
    for limb in (_ARM, _LEG)
    for side, letter in _SIDES
    for name, parent, point, segment in limb
)
"""Name, parent, point (joint, tip or pivot), and segment of each joint, depth first."""
ENDS = tuple(name for name, *_ in RIG if name not in {parent for _, parent, *_ in RIG})

_FRONT, _LEFT, _UP = np.eye(3)
_SEGMENTS = [SEGMENT_NAMES.index(segment) for *_, segment in RIG]
_POINT_NAMES = JOINT_NAMES + TIP_NAMES + PIVOT_NAMES
# A foot that reaches less far ahead at rest (m) has no direction.
_AHEAD = 0.005


@dataclass(frozen=True)
class Rig:
    """Offsets and rotations of the joints, in the order of `RIG`."""

    offsets: Float[np.ndarray, "joints 3"]
    """Offset from the parent, at rest (m)."""
    root: Float[np.ndarray, "frames 3"]
    """Position of the first joint in the world (m)."""
    rotations: Float[np.ndarray, "frames joints 3 3"]
    """Rotation from rest to the world; end points have those of their parents."""


@dataclass(frozen=True)
class TPose:
    """The template in a T-pose. It takes as long to make as some fifty poses of it."""

    offsets: Float[np.ndarray, "joints 3"]
    """Offset of each joint from its parent (m)."""
    upright: Float[np.ndarray, "segments=17 3 3"]
    """Rotation of each segment from the template's rest to the T-pose."""


def rig_of(skeleton: Skeleton, pose: Pose) -> Rig:
    """The animation skeleton that moves as the template does: its points are where forward kinematics place them.

    Args:
        skeleton: The template (m).
        pose: Its poses, with the axis ``frames``, in a world with z up.
    """
    return rig_from(t_pose_of(skeleton), pose)


def rig_from(start: TPose, pose: Pose) -> Rig:
    """The same as [`rig_of`][], from the template's T-pose."""
    rotations = np.asarray(pose.rotations, np.float64) @ start.upright.swapaxes(-1, -2)
    return Rig(start.offsets, np.asarray(pose.root, np.float64), rotations[:, _SEGMENTS])


def t_pose_of(skeleton: Skeleton) -> TPose:
    """The template (m), standing with its arms to the sides, facing x, with z up."""
    upright, rest = _to_t_pose(skeleton), _at_rest(skeleton)
    of = {name: (rest[point], segment) for (name, _, point, _), segment in zip(RIG, _SEGMENTS, strict=True)}
    offsets = [np.zeros(3)]
    for name, parent, *_ in RIG[1:]:
        start, carrier = of[parent]
        offsets.append(upright[carrier] @ (of[name][0] - start))
    return TPose(np.stack(offsets), upright)


def placed(rig: Rig) -> Float[np.ndarray, "frames joints 3"]:
    """Positions of the joints in the world (m)."""
    names = [name for name, *_ in RIG]
    points = np.empty((*rig.rotations.shape[:2], 3))
    points[:, 0] = rig.root
    for j, (_, parent, *_) in enumerate(RIG[1:], 1):
        p = names.index(parent)
        points[:, j] = points[:, p] + rig.rotations[:, p] @ rig.offsets[j]
    return points


def _at_rest(skeleton: Skeleton) -> dict[str, Float[np.ndarray, "3"]]:
    """Joints, tips and pivots at rest (m, body frame)."""
    points = np.concatenate([skeleton.rest_joints, skeleton.rest_tips, skeleton.pivots]).astype(np.float64)
    return dict(zip(_POINT_NAMES, points, strict=True))


def _to_t_pose(skeleton: Skeleton) -> Float[np.ndarray, "segments=17 3 3"]:
    """Rotation of each segment from the template's rest to a T-pose: arms to the sides, legs down, feet ahead.

    Trunk and head stay. Hinges of elbows point up or down and those of knees to the left, so that a limb which bends
    as a hinge does so about one axis of the file. A bone beyond may go sideways by a degree or two, as shanks do.
    """
    at, turns = _at_rest(skeleton), {name: np.eye(3) for name in SEGMENT_NAMES}
    for side, out in (("l_", _LEFT), ("r_", -_LEFT)):
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
