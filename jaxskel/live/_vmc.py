"""Poses as an avatar's bones in Unity, which is how the VMC protocol (Virtual Motion Capture) sends them.

Unity is left-handed with Y up, and a person who faces Z has the right hand at +X. Bones have Unity's names
(`HumanBodyBones`); each has a position and a rotation relative to its parent, and in a T-pose that faces Z no rotation
at all, as in the normalised models of VRM 0. See https://protocol.vmc.info/english and
https://docs.unity3d.com/ScriptReference/HumanBodyBones.html.

Skeletons of poses are right-handed at rest: x to the front, y to the left, z up. So a point (x, y, z) of a world with
z up is (-y, z, x) in Unity, and a rotation R is M R M^T with the mirroring M of that change.
"""

from dataclasses import dataclass

import numpy as np
import scipy  # imports its parts when they are first used
from jaxtyping import Float

from ..body import HUMAN_15, Pose, SkeletonTemplate
from ..io.poses import RIG, TPose, rig_from, t_pose_of, with_up
from ..poses import Poses

_TO_UNITY = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
# Names of the bones that Unity calls otherwise than BVH does; palms, finger tips and the like are none.
_LIMBS = {
    "Arm": "UpperArm", "ForeArm": "LowerArm", "UpLeg": "UpperLeg", "Leg": "LowerLeg", "ToeBase": "Toes",
    "Shoulder": "Shoulder", "Hand": "Hand", "Foot": "Foot",
}  # fmt: skip
_UNITY_NAMES = {name: name for name in ("Hips", "Spine", "Neck", "Head")} | {
    side + ours: side + theirs for side in ("Left", "Right") for ours, theirs in _LIMBS.items()
}
_ROWS = [row for row, (name, *_) in enumerate(RIG) if name in _UNITY_NAMES]
BONE_NAMES = tuple(_UNITY_NAMES[RIG[row][0]] for row in _ROWS)
"""The bones, parents before their children; the first is the root, Hips."""
BONE_PARENTS = tuple(
    BONE_NAMES.index(_UNITY_NAMES[RIG[row][1]]) if RIG[row][1] else -1 for row in _ROWS
)  # fmt: skip
"""Index of each bone's parent; -1 for Hips."""


@dataclass(frozen=True)
class Bones:
    """Bones of one frame, in the order of `BONE_NAMES`.

    Attributes:
        positions: Position relative to the parent, in its frame; of Hips, in the world (m).
        quaternions: Rotation relative to the parent from the T-pose: x, y, z, w.
    """

    positions: Float[np.ndarray, "bones=20 3"]
    quaternions: Float[np.ndarray, "bones=20 4"]


def bones_of(poses: Poses, start: TPose | None = None) -> Bones | None:
    """The bones of the first frame; None if it has no pose or no rotations are known.

    Args:
        poses: One frame or more. Lengths are those of the template `poses.skeleton`.
        start: The template's T-pose, if it has been made before.

    Raises:
        ValueError: The template is not the paper's human.
    """
    check_avatar(poses.template)
    if poses.rotations is None or poses.skeleton is None or not poses.has_pose[0]:
        return None
    standing = with_up(poses, "+Z")
    start = t_pose_of(poses.skeleton) if start is None else start
    rig = rig_from(start, Pose(standing.joints[:1, 0], standing.pose.rotations[:1]))
    whole = _TO_UNITY @ rig.rotations[0, _ROWS] @ _TO_UNITY.T
    parents = list(BONE_PARENTS[1:])
    local = np.concatenate([whole[:1], whole[parents].swapaxes(-1, -2) @ whole[1:]])
    positions = rig.offsets[_ROWS] @ _TO_UNITY.T
    positions[0] = _TO_UNITY @ rig.root[0]
    return Bones(positions, scipy.spatial.transform.Rotation.from_matrix(local).as_quat(canonical=True))


def check_avatar(template: SkeletonTemplate) -> None:
    """Refuse a template that has no avatar.

    Raises:
        ValueError: The template is not the paper's human.
    """
    if template != HUMAN_15:
        raise ValueError(
            f"template: {template.name} has no bones of an avatar, as VMC knows humans only; leave out --osc"
        )
