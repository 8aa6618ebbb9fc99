"""Joint angles of poses, by the conventions of the International Society of Biomechanics (ISB).

Sources: Wu et al. 2002 (hip, ankle, spine) and 2005 (elbow, wrist), J. Biomechanics 35 and 38; Grood & Suntay 1983,
J. Biomech. Eng. 105 (knee); Baker 2001, Human Movement Science 20 (pelvis). Names and signs are those of the
coordinates of OpenSim's full-body model (Rajagopal et al. 2016, IEEE Trans. Biomed. Eng. 63) where it has them.

Each segment has axes that ISB calls X (front), Y (up) and Z (to the right), parallel to those of all others in the
neutral posture. A joint's angles are those of the Cardan sequence Z-X'-Y'': flexion about Z of the proximal segment,
then ab- or adduction about the floating axis, then axial rotation about Y of the distal one. A left joint's angles are
those of the mirrored right joint.

All this is said of the paper's human. Of any other template, the flexion of its hinges is told.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from .._math.euler import to_zxy
from .._math.up_axes import rotation_to_z_up
from ..body import HUMAN_15, SEGMENT_NAMES, Skeleton, hinge_axes, neutral_posture
from ._poses import Poses

# Rows: the axes X, Y and Z of ISB in the body frame (x to the front, y to the left, z up).
_RIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_LEFT = _RIGHT @ np.diag([1.0, -1.0, 1.0])  # mirrored
# Palms face the thighs in the neutral posture: there, the wrist's axis of flexion points to the front.
_HAND = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
# Rotation about the vertical is the first of the pelvis' angles, and tilt the last one: the axes Z and Y change places.
_PELVIS = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
# How strongly arms come back to small angles after a gimbal lock, and how far (rad) a segment turns against its
# neighbour at most: see `to_zxy`.
_HOME, _MOST = 2.0, 1.5 * np.pi

_TRUNK = (
    ("pelvis", "chest", ("lumbar_extension", "lumbar_bending", "lumbar_rotation")),
    ("chest", "head", ("neck_extension", "neck_bending", "neck_rotation")),
)  # fmt: skip
_LEG = (
    ("pelvis", "{}_thigh", ("hip_flexion", "hip_adduction", "hip_rotation")),
    ("{}_thigh", "{}_shank", ("knee_angle", "knee_adduction", "knee_rotation")),
    ("{}_shank", "{}_foot", ("ankle_angle", "ankle_inversion", "ankle_rotation")),
)  # fmt: skip
_ARM = (
    ("chest", "{}_upper_arm", ("arm_flex", "arm_add", "arm_rot")),
    ("{}_upper_arm", "{}_forearm", ("elbow_flex", "elbow_add", "pro_sup")),
    ("{}_forearm", "{}_hand", ("wrist_flex", "wrist_dev", "wrist_rot")),
)  # fmt: skip


def _of_side(side: str, limb: tuple[tuple[str, str, tuple[str, ...]], ...]) -> list[tuple[str, str, tuple[str, ...]]]:
    return [(a.format(side), b.format(side), tuple(f"{name}_{side}" for name in names)) for a, b, names in limb]


_JOINTS = (
    *_of_side("r", _LEG), *_of_side("l", _LEG), *_TRUNK, *_of_side("r", _ARM), *_of_side("l", _ARM),
)  # fmt: skip
_PARENTS, _CHILDREN = ([SEGMENT_NAMES.index(joint[i]) for joint in _JOINTS] for i in (0, 1))
_AXES = np.stack(
    [
        (_HAND if child.endswith("hand") else np.eye(3)) @ (_LEFT if child.startswith("l_") else _RIGHT)
        for _, child, _ in _JOINTS
    ]
)

ANGLE_NAMES = (
    "pelvis_tilt", "pelvis_list", "pelvis_rotation", *(name for *_, names in _JOINTS for name in names),
)  # fmt: skip
"""Names of the joint angles: those of OpenSim's coordinates, and of what OpenSim's model does not have."""
# Knees bend backwards, which is negative about Z, but all count it positive.
_SIGNS = np.array([-1.0 if name.startswith("knee_angle") else 1.0 for name in ANGLE_NAMES])


@dataclass(frozen=True)
class JointAngles:
    """Joint angles of all frames.

    Attributes:
        names: `ANGLE_NAMES` of the paper's human; the page on conventions says what is positive. Of any other template,
            ``<joint>_flexion`` of each hinge.
        values: Angles (rad), zero in the neutral posture, flexions where the bones are in line; NaN in a frame without
            a pose.
    """

    names: tuple[str, ...]
    values: Float[np.ndarray, "frames angles"]


def joint_angles(poses: Poses) -> JointAngles:
    """Angles of the joints, zero where the template stands straight with hanging arms, palms to the thighs.

    The pelvis is told relative to the world: its rotation about the vertical is zero where a person faces x of the
    world turned so that z is up, and tilt and list do not depend on it. All other angles are those between two
    segments, so they do not depend on the world; arms are told relative to the chest.

    Angles are continuous over time, also across frames without a pose, and may exceed half a turn; those of the pelvis
    count whole turns. Where a joint's
    second angle is a right angle (an arm straight to the side), its first and third cannot be told apart (gimbal lock).

    Of any template but the paper's human, these are the flexions of its hinges, each between the bones that meet there,
    positive to where the hinge bends to.

    Raises:
        ValueError: The poses hold no rotations, or the template has no hinges.
    """
    rotations = np.asarray(poses.pose.rotations, np.float64)
    if poses.skeleton is None:
        raise ValueError("the poses hold rotations, but no skeleton that they refer to; reconstruct again")
    if poses.template != HUMAN_15:
        return _flexions(rotations, poses.skeleton)
    known = poses.has_pose
    values = np.full((len(poses), len(ANGLE_NAMES)), np.nan)
    if known.any():
        upright = rotation_to_z_up(poses.up) @ rotations[known]
        values[known] = _angles(upright @ neutral_posture(poses.skeleton).swapaxes(-1, -2))
    return JointAngles(ANGLE_NAMES, values)


def _flexions(rotations: Float[np.ndarray, "frames segments 3 3"], skeleton: Skeleton) -> JointAngles:
    template, rest = skeleton.template, np.asarray(skeleton.rest_joints, np.float64)
    if not template.hinges:
        raise ValueError(f"template: {template.name} has no hinges, so there are no joint angles; leave them out")
    joints, outer, ends = np.array([hinge[:3] for hinge in template.hinges]).T
    inner = np.array(template.segment_parents)[outer]
    points = np.concatenate([rest, skeleton.rest_tips, skeleton.pivots])
    upper, lower, axes = (
        np.einsum("fhij,hj->fhi", rotations[:, segments], bones)
        for segments, bones in (
            (inner, rest[joints] - rest[template.point_parents[joints]]),
            (outer, points[ends] - rest[joints]),
            (inner, np.asarray(hinge_axes(skeleton), np.float64)),
        )
    )
    angles = np.arctan2((axes * np.cross(upper, lower)).sum(-1), (upper * lower).sum(-1))
    angles = np.where(angles < -np.pi / 2, angles + 2 * np.pi, angles)  # folded beyond half a turn
    return JointAngles(tuple(f"{template.joint_names[joint]}_flexion" for joint in joints), angles)


def _angles(rotations: Float[np.ndarray, "frames segments=17 3 3"]) -> Float[np.ndarray, "frames angles"]:
    """Angles (rad) from rotations from the neutral posture to a world with z up."""
    axes = _PELVIS @ _RIGHT
    vertical, sideways, tilt = np.moveaxis(to_zxy(axes @ rotations[:, :1] @ axes.T, home=_HOME)[:, 0], -1, 0)
    between = rotations[:, _PARENTS].swapaxes(-1, -2) @ rotations[:, _CHILDREN]
    others = to_zxy(_AXES @ between @ _AXES.swapaxes(-1, -2), home=_HOME, most=_MOST)
    pelvis = np.stack([tilt, -sideways, vertical], -1)
    return _SIGNS * np.concatenate([pelvis, others.reshape(len(others), -1)], 1)
