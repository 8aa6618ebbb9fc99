"""An animation skeleton: rotating joints with constant offsets, at rest in a T-pose.

At rest x is to the front, y to the left, z up.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ...body import JOINT_NAMES, PIVOT_NAMES, SEGMENT_NAMES, TIP_NAMES, Pose, Skeleton, t_posture

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

_SEGMENTS = [SEGMENT_NAMES.index(segment) for *_, segment in RIG]
_POINT_NAMES = JOINT_NAMES + TIP_NAMES + PIVOT_NAMES


@dataclass(frozen=True)
class Rig:
    """Offsets and rotations of the joints, in the order of `RIG`.

    Attributes:
        offsets: Offset from the parent, at rest (m).
        root: Position of the first joint in the world (m).
        rotations: Rotation from rest to the world; end points have those of their parents.
    """

    offsets: Float[np.ndarray, "joints 3"]
    root: Float[np.ndarray, "frames 3"]
    rotations: Float[np.ndarray, "frames joints 3 3"]


@dataclass(frozen=True)
class TPose:
    """The template in a T-pose. It takes as long to make as some fifty poses of it.

    Attributes:
        offsets: Offset of each joint from its parent (m).
        upright: Rotation of each segment from the template's rest to the T-pose.
    """

    offsets: Float[np.ndarray, "joints 3"]
    upright: Float[np.ndarray, "segments 3 3"]


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
    upright, rest = t_posture(skeleton), _at_rest(skeleton)
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
