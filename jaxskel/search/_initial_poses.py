"""The initial pose from the seven labelled nodes and the graph paths between them (Sect. 3.3)."""

import numpy as np
from jaxtyping import Float

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

# Of each limb: parent, upper and lower segment, then upper joint, middle joint, end joint and tip.
_LIMBS = {
    L_HAND: ("l_clavicle", "l_upper_arm", "l_forearm", "l_shoulder", "l_elbow", "l_hand", "l_fingertip"),
    R_HAND: ("r_clavicle", "r_upper_arm", "r_forearm", "r_shoulder", "r_elbow", "r_hand", "r_fingertip"),
    L_FOOT: ("pelvis", "l_thigh", "l_shank", "l_hip", "l_knee", "l_foot", "l_toetip"),
    R_FOOT: ("pelvis", "r_thigh", "r_shank", "r_hip", "r_knee", "r_foot", "r_toetip"),
}


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
    count = len(limbs.paths)
    at_rest = [*np.asarray(skeleton.rest_joints), *np.asarray(skeleton.rest_tips), *np.asarray(skeleton.pivots)]
    rest: dict[str, np.ndarray] = dict(zip((*JOINT_NAMES, *TIP_NAMES, *PIVOT_NAMES), at_rest, strict=True))
    parent = {name: JOINT_NAMES[JOINT_PARENTS[i]] for i, name in enumerate(JOINT_NAMES) if i}
    rotations = np.tile(np.eye(3), (count, len(SEGMENT_NAMES), 1, 1))
    number = {name: i for i, name in enumerate(SEGMENT_NAMES)}

    known = np.linalg.norm(facing, axis=1) > 0.5
    front = np.where(known[:, None], facing, [1.0, 0.0, 0.0])
    left = np.cross([0.0, 0.0, 1.0], front)
    spine = limbs.neck - limbs.pelvis
    spine = np.where(np.linalg.norm(spine, axis=1, keepdims=True) > 0.05, spine, [0.0, 0.0, 1.0])
    trunk = frame(spine, left)
    # At rest, the neck need not be straight above the pelvis.
    lean = aligning(_unit_or_down(rest["neck"]), np.array([0.0, 0.0, 1.0]))
    rotations[:, number["pelvis"]] = trunk @ lean
    rotations[:, number["chest"]] = trunk @ lean

    def turn(segment: str, bone: np.ndarray, goal: np.ndarray) -> None:
        """Rotate a segment from its parent's rotation by the least rotation that points its bone at the goal."""
        carried = rotations[:, SEGMENT_PARENTS[number[segment]]]
        rotations[:, number[segment]] = aligning(carried @ _unit_or_down(bone), _unit_or_down(goal)) @ carried

    turn("head", rest["head"] - rest["neck"], limbs.ends[:, HEAD] - limbs.neck)
    for side in "lr":
        rotations[:, number[f"{side}_clavicle"]] = rotations[:, number["chest"]]
    for label, (girdle, upper, lower, top, middle, end, tip) in _LIMBS.items():
        # Distances along the graph from the end node, which lies short of the tip.
        last, lower_bone = np.linalg.norm(rest[tip] - rest[end]), np.linalg.norm(rest[end] - rest[middle])
        to_end = END_NODE_REACH * last
        to_middle = to_end + lower_bone
        if end.endswith("foot"):
            ankle = rest[end.replace("foot", "ankle")]
            over_ankle = np.linalg.norm(rest[middle] - ankle) + np.linalg.norm(rest[tip] - ankle)
            to_middle = over_ankle - (1 - END_NODE_REACH) * last
        base = limbs.neck if top.endswith("shoulder") else limbs.pelvis
        base = base + rotations[:, number[girdle]] @ (rest[top] - rest[parent[top]])
        goal_middle, goal_end = limbs.at(label, to_middle), limbs.at(label, to_end)
        found = limbs.found[:, label, None]
        hanging = rotations[:, number[girdle]]
        turn(
            upper,
            rest[middle] - rest[top],
            np.where(found, goal_middle - base, hanging @ (rest[middle] - rest[top])),
        )
        turn(
            lower,
            rest[end] - rest[middle],
            np.where(found, goal_end - goal_middle, hanging @ (rest[end] - rest[middle])),
        )
    for segment in SEGMENT_OF_PIVOT:
        rotations[:, segment] = rotations[:, SEGMENT_PARENTS[segment]]
    return Pose(root=limbs.pelvis.copy(), rotations=rotations)


def _unit_or_down(vector: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.where(length > 1e-6, vector / np.maximum(length, 1e-6), [0.0, 0.0, -1.0])
