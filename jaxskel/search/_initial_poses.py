"""The initial pose from the seven labelled nodes and the graph paths between them (Sect. 3.3)."""

import numpy as np
from jaxtyping import Float, Int

from .._math.rotations import aligning, frame
from ..body import (
    JOINT_NAMES,
    JOINT_PARENTS,
    PIVOT_NAMES,
    SEGMENT_NAMES,
    SEGMENT_OF_PIVOT,
    SEGMENT_PARENTS,
    TIP_NAMES,
    Pose,
    Skeleton,
)
from ..matching import END_NODE_REACH, HEAD, L_FOOT, L_HAND, R_FOOT, R_HAND, Limbs


def _numbers(among: tuple[str, ...], *names: str) -> Int[np.ndarray, " names"]:
    return np.array([among.index(name) for name in names])


# The four limbs, arms first: their labels, the segments that carry them, their two bones, and their points.
_LIMBS = np.array([L_HAND, R_HAND, L_FOOT, R_FOOT])
_GIRDLES = _numbers(SEGMENT_NAMES, "l_clavicle", "r_clavicle", "pelvis", "pelvis")
_UPPER = _numbers(SEGMENT_NAMES, "l_upper_arm", "r_upper_arm", "l_thigh", "r_thigh")
_LOWER = _numbers(SEGMENT_NAMES, "l_forearm", "r_forearm", "l_shank", "r_shank")
_TOP = _numbers(JOINT_NAMES, "l_shoulder", "r_shoulder", "l_hip", "r_hip")
_ABOVE = np.array(JOINT_PARENTS)[_TOP]
_MIDDLE = _numbers(JOINT_NAMES, "l_elbow", "r_elbow", "l_knee", "r_knee")
_END = _numbers(JOINT_NAMES, "l_hand", "r_hand", "l_foot", "r_foot")
_TIPS = _numbers(TIP_NAMES, "l_fingertip", "r_fingertip", "l_toetip", "r_toetip")
_ANKLES = _numbers(PIVOT_NAMES, "l_ankle", "r_ankle")
_NECK, _HEAD = JOINT_NAMES.index("neck"), JOINT_NAMES.index("head")
_CHEST, _HEAD_SEGMENT = SEGMENT_NAMES.index("chest"), SEGMENT_NAMES.index("head")
_TRUNK = _numbers(SEGMENT_NAMES, "pelvis", "chest", "l_clavicle", "r_clavicle")


def initial_poses(limbs: Limbs, facing: Float[np.ndarray, "frames 3"], skeleton: Skeleton) -> Pose:
    """Turn the template's segments so that its joints come to the labelled nodes (Sect. 3.3).

    Pelvis, neck and head follow from their nodes; elbow, knee, hand and foot are points on the limb's path, at the
    template's distance from its end node. A limb without an end node stays in its rest position.

    Args:
        limbs: Labelled limbs (m) in a world with z up, left and right told apart.
        facing: Horizontal unit vector in which the body faces; taken as the world's x axis where it is zero.
        skeleton: Template.

    Returns:
        One pose for each frame (m, in the world).
    """
    rest = np.asarray(skeleton.rest_joints, float)
    rotations = np.tile(np.eye(3), (len(limbs.paths), len(SEGMENT_NAMES), 1, 1))

    known = np.linalg.norm(facing, axis=1) > 0.5
    front = np.where(known[:, None], facing, [1.0, 0.0, 0.0])
    left = np.cross([0.0, 0.0, 1.0], front)
    spine = limbs.neck - limbs.pelvis
    spine = np.where(np.linalg.norm(spine, axis=1, keepdims=True) > 0.05, spine, [0.0, 0.0, 1.0])
    # At rest, the neck need not be straight above the pelvis.
    trunk = frame(spine, left) @ aligning(_unit_or_down(rest[_NECK]), np.array([0.0, 0.0, 1.0]))
    rotations[:, _TRUNK] = trunk[:, None]
    head = limbs.ends[:, [HEAD]] - limbs.neck[:, None]
    rotations[:, [_HEAD_SEGMENT]] = _pointed(rotations[:, [_CHEST]], (rest[_HEAD] - rest[_NECK])[None], head)

    to_middle, to_end = _along_limbs(skeleton)
    middle, end = limbs.at(_LIMBS, to_middle), limbs.at(_LIMBS, to_end)
    girdles = rotations[:, _GIRDLES]
    base = limbs.inner[:, [1, 1, 0, 0]] + _turned(girdles, rest[_TOP] - rest[_ABOVE])
    upper, lower = rest[_MIDDLE] - rest[_TOP], rest[_END] - rest[_MIDDLE]
    found = limbs.found[:, _LIMBS, None]
    rotations[:, _UPPER] = _pointed(girdles, upper, np.where(found, middle - base, _turned(girdles, upper)))
    lower_goal = np.where(found, end - middle, _turned(girdles, lower))
    rotations[:, _LOWER] = _pointed(rotations[:, _UPPER], lower, lower_goal)
    for segment in SEGMENT_OF_PIVOT:
        rotations[:, segment] = rotations[:, SEGMENT_PARENTS[segment]]
    return Pose(root=limbs.pelvis.copy(), rotations=rotations)


def _along_limbs(skeleton: Skeleton) -> tuple[Float[np.ndarray, "limbs=4"], Float[np.ndarray, "limbs=4"]]:
    """Distances of middle and end joints along the graph from the end node, which lies short of the tip (m)."""
    rest, tips = np.asarray(skeleton.rest_joints, float), np.asarray(skeleton.rest_tips, float)[_TIPS]
    last = np.linalg.norm(tips - rest[_END], axis=1)
    to_end = END_NODE_REACH * last
    to_middle = to_end + np.linalg.norm(rest[_END] - rest[_MIDDLE], axis=1)
    ankles = np.asarray(skeleton.pivots, float)[_ANKLES]
    over_ankle = np.linalg.norm(rest[_MIDDLE[2:]] - ankles, axis=1) + np.linalg.norm(tips[2:] - ankles, axis=1)
    to_middle[2:] = over_ankle - (1 - END_NODE_REACH) * last[2:]
    return to_middle, to_end


def _pointed(
    carried: Float[np.ndarray, "frames limbs 3 3"],
    bones: Float[np.ndarray, "limbs 3"],
    goals: Float[np.ndarray, "frames limbs 3"],
) -> Float[np.ndarray, "frames limbs 3 3"]:
    """Segments turned from their parents' rotations by the least rotation that points their bones at the goals."""
    return aligning(_turned(carried, _unit_or_down(bones)), _unit_or_down(goals)) @ carried


def _turned(
    rotations: Float[np.ndarray, "frames limbs 3 3"], vectors: Float[np.ndarray, "limbs 3"]
) -> Float[np.ndarray, "frames limbs 3"]:
    return np.einsum("flij,lj->fli", rotations, vectors)


def _unit_or_down(vector: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.where(length > 1e-6, vector / np.maximum(length, 1e-6), [0.0, 0.0, -1.0])
