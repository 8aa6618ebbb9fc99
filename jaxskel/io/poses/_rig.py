"""An animation skeleton: rotating joints with constant offsets. A human is at rest in a T-pose.

At rest x is to the front, y to the left, z up. A row of a rig is the name of a joint, its parent's name, its point
(joint, tip or pivot of the template), and the segment with which it rotates.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from ...body import HUMAN_15, Pose, Skeleton, SkeletonTemplate, t_posture

Row = tuple[str, str, str, str]

# The rows of the paper's human. The trunk rotates apart from the pelvis, which holds the hips, and each collar bone by
# itself, so these joints coincide with their parents.
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
"""The rows of the paper's human, depth first."""


@dataclass(frozen=True)
class Rig:
    """Offsets and rotations of the joints.

    Attributes:
        rows: The joints, depth first.
        offsets: Offset from the parent, at rest (m).
        root: Position of the first joint in the world (m).
        rotations: Rotation from rest to the world; end points have those of their parents.
    """

    rows: tuple[Row, ...]
    offsets: Float[np.ndarray, "joints 3"]
    root: Float[np.ndarray, "frames 3"]
    rotations: Float[np.ndarray, "frames joints 3 3"]


@dataclass(frozen=True)
class TPose:
    """A human in a T-pose, any other skeleton at rest. It takes as long to make as some fifty poses of it.

    Attributes:
        rows: The joints, depth first.
        segments: Index of the segment with which each joint rotates.
        offsets: Offset of each joint from its parent (m).
        upright: Rotation of each segment from the template's rest to the T-pose.
    """

    rows: tuple[Row, ...]
    segments: list[int]
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
    return Rig(start.rows, start.offsets, np.asarray(pose.root, np.float64), rotations[:, start.segments])


def t_pose_of(skeleton: Skeleton) -> TPose:
    """A human (m) standing with its arms to the sides, facing x, with z up; any other skeleton at rest."""
    template, rest = skeleton.template, _at_rest(skeleton)
    rows = rig_rows(template)
    segments = [template.segment_names.index(segment) for *_, segment in rows]
    upright = t_posture(skeleton) if template == HUMAN_15 else np.tile(np.eye(3), (len(template.segment_names), 1, 1))
    of = {name: (rest[point], segment) for (name, _, point, _), segment in zip(rows, segments, strict=True)}
    offsets = [np.zeros(3)]
    for name, parent, *_ in rows[1:]:
        start, carrier = of[parent]
        offsets.append(upright[carrier] @ (of[name][0] - start))
    return TPose(rows, segments, np.stack(offsets), upright)


@lru_cache(maxsize=16)
def rig_rows(template: SkeletonTemplate) -> tuple[Row, ...]:
    """The joints of a template's animation skeleton, depth first: those of animation programs for the paper's human.

    Any other has the template's names. A joint rotates with what begins at it. If several segments begin there, those
    by which it is not carried itself have joints of their own at the same place, named after both.
    """
    return RIG if template == HUMAN_15 else tuple(_rows_from(template, 0, "", 0))


def _rows_from(template: SkeletonTemplate, point: int, start: str, carrier: int) -> list[Row]:
    """The row of a point below the row `start`, which a segment carries there, and the rows of what hangs on it."""
    name, segments, first = template.point_names[point], template.segment_names, _first_segments(template)
    hanging = np.flatnonzero(template.point_parents == point).tolist()
    turning = list(dict.fromkeys(first[end] for end in hanging))
    own = turning[0] if len(turning) == 1 else carrier
    rows = [(name, start, name, segments[own])]
    for segment in turning:
        place = name if segment == own else f"{name}_{segments[segment]}"
        if place != name:
            rows.append((place, name, name, segments[segment]))
        for end in hanging:
            if first[end] == segment:
                rows += _bone_rows(template, end, place)
    return rows


def _bone_rows(template: SkeletonTemplate, end: int, start: str) -> list[Row]:
    """The rows of a bone that begins at the row `start`, and of what hangs on its end."""
    for pivot, segment in zip(template.pivots, template.segment_of_pivot, strict=True):
        if pivot.joint == end:
            row = (pivot.name, start, pivot.name, template.segment_names[segment])
            return [row, *_rows_from(template, end, pivot.name, segment)]
    return _rows_from(template, end, start, _first_segments(template)[end])


def _first_segments(template: SkeletonTemplate) -> tuple[int, ...]:
    """The segment that carries the first part of the bone to each joint, then each tip."""
    return template.segment_of_joint + template.segment_of_tip


def placed(rig: Rig) -> Float[np.ndarray, "frames joints 3"]:
    """Positions of the joints in the world (m)."""
    names = [name for name, *_ in rig.rows]
    points = np.empty((*rig.rotations.shape[:2], 3))
    points[:, 0] = rig.root
    for j, (_, parent, *_) in enumerate(rig.rows[1:], 1):
        p = names.index(parent)
        points[:, j] = points[:, p] + rig.rotations[:, p] @ rig.offsets[j]
    return points


def _at_rest(skeleton: Skeleton) -> dict[str, Float[np.ndarray, "3"]]:
    """Joints, tips and pivots at rest (m, body frame)."""
    points = np.concatenate([skeleton.rest_joints, skeleton.rest_tips, skeleton.pivots]).astype(np.float64)
    return dict(zip(skeleton.template.point_names + skeleton.template.pivot_names, points, strict=True))
