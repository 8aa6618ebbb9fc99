"""Retargeting of captured motion to a skeleton: its bones take the directions of the captured bones."""

import numpy as np
from jaxtyping import Float

from .._math.rotations import aligning
from ..body import JOINT_NAMES, JOINT_PARENTS, SEGMENT_NAMES, TIP_NAMES, Pose, Skeleton, place_joints
from ..io.mocap import Motion
from ..recording import rotation_to_z_up
from ._anatomy import TOE_CLEARANCE

# Names of the joints in motion files; {} is the prefix of the side. With two names, the joint is the midpoint between
# them; with several entries, the first complete one is used.
_Names = dict[str, tuple[tuple[str, ...], ...]]
_ACCLAIM: _Names = {
    "pelvis": (("root",),), "neck": (("thorax",),), "head": (("upperneck", "head"), ("head",)),
    "shoulder": (("{}clavicle",),), "elbow": (("{}humerus",),), "hand": (("{}hand",), ("{}wrist",)),
    "hip": (("{}hipjoint",),), "knee": (("{}femur",),), "foot": (("{}foot",), ("{}tibia",)),
}  # fmt: skip
_MOTIONBUILDER: _Names = {
    "pelvis": (("Hips",),), "neck": (("Neck",),),
    "head": (("Head", "Head_End"), ("Head", "HeadTop_End"), ("Head",)),
    "shoulder": (("{}Arm",),), "elbow": (("{}ForeArm",),), "hand": (("{}HandIndex1",), ("{}Hand",)),
    "hip": (("{}UpLeg",),), "knee": (("{}Leg",),), "foot": (("{}ToeBase",), ("{}Foot",)),
}  # fmt: skip
_BIOVISION: _Names = {
    "pelvis": (("Hips",),), "neck": (("Neck",),), "head": (("Head", "Head_End"), ("Head",)),
    "shoulder": (("{}Shoulder",),), "elbow": (("{}Elbow",),),
    "hand": (("{}Wrist", "{}Wrist_End"), ("{}Wrist",)),
    "hip": (("{}Hip",),), "knee": (("{}Knee",),), "foot": (("{}Toe",), ("{}Ankle_End",), ("{}Ankle",)),
}  # fmt: skip
_TABLES = ((_ACCLAIM, ("l", "r")), (_MOTIONBUILDER, ("Left", "Right")), (_BIOVISION, ("Left", "Right")))
# Sine of the bend above which a knee or an elbow fully determines the twist of the limb.
_SURE_BEND = 0.4
_AT = {name: i for i, name in enumerate(JOINT_NAMES)}


def find_joints(motion: Motion) -> Float[np.ndarray, "frames joints=15 3"]:
    """The 15 joints of the skeleton in a captured motion, found by name, in the world of the motion (m).

    Knows the names in the CMU database's ASF files and in common BVH files (MotionBuilder, also with a prefix
    such as ``mixamorig:``, and Biovision).

    Raises:
        ValueError: Joints are missing; the message lists them.
    """
    index = {name.rpartition(":")[2]: i for i, name in reversed(list(enumerate(motion.names)))}
    best: list[str] | None = None
    for table, prefixes in _TABLES:
        found, missing = [], []
        for joint in JOINT_NAMES:
            options = _options(table, prefixes, joint)
            names = next((option for option in options if all(name in index for name in option)), None)
            if names is None:
                missing.append(f"{joint} ({' or '.join(option[0] for option in options)})")
            else:
                found.append(motion.positions[:, [index[name] for name in names]].mean(1))
        if not missing:
            return np.stack(found, 1)
        if best is None or len(missing) < len(best):
            best = missing
    assert best is not None
    raise ValueError(f"the motion lacks {', '.join(best)}; its joints are {', '.join(motion.names)[:200]}")


def _options(table: _Names, prefixes: tuple[str, str], joint: str) -> list[tuple[str, ...]]:
    side = joint[:2] in ("l_", "r_")
    prefix = prefixes[joint[0] == "r"] if side else ""
    return [tuple(name.format(prefix) for name in option) for option in table[joint[2:] if side else joint]]


def retarget(motion: Motion, skeleton: Skeleton) -> Pose:
    """Transfer a captured motion to a skeleton.

    The bones that end in elbows, hands, knees and feet take the captured directions exactly. Pelvis, chest, head and
    collar bones take the captured rotations relative to the rest pose, because the files place the neck and the hips
    at other heights of the trunk.

    Args:
        motion: The clip, from `read_asf_amc` or `read_bvh`, with an upright rest pose.
        skeleton: The skeleton to move (m).

    Returns:
        A stack of poses, one for each frame (m). World: z up, the floor at z = 0. The path of the pelvis is scaled by
        the ratio of leg lengths; the height of the lower foot above the floor is the captured one, scaled.

    Raises:
        ValueError: Joints are missing, or two joints of one bone coincide.
    """
    at_rest = Motion(motion.names, motion.parents, motion.rest[None], motion.rest, motion.fps, motion.up)
    to_z_up = rotation_to_z_up(motion.up).T
    joints, source_rest = find_joints(motion) @ to_z_up, find_joints(at_rest) @ to_z_up
    bones = _unit_bones(joints, "the motion")
    rest = _unit_bones(np.asarray(skeleton.rest_joints, np.float64)[None], "the skeleton at rest")[0]
    turned = {
        name: axes @ axes_at_rest.swapaxes(-1, -2) @ _facing(source_rest)
        for (name, axes), axes_at_rest in zip(
            _trunk(joints, bones).items(),
            _trunk(source_rest, _unit_bones(source_rest, "the motion at rest")).values(),
            strict=True,
        )
    }
    for side in ("l_", "r_"):
        for upper, lower, joint, end, parent, bend in (
            ("upper_arm", "forearm", "elbow", "hand", "chest", 1.0),
            ("thigh", "shank", "knee", "foot", "pelvis", -1.0),
        ):
            first_rest, second_rest = rest[_AT[side + joint]], rest[_AT[side + end]]
            first, second = bones[:, _AT[side + joint]], bones[:, _AT[side + end]]
            swung = aligning(turned[parent] @ first_rest, first) @ turned[parent]
            hinge = _hinge(first, second, swung[..., 0], bend)
            front = np.array([1.0, 0.0, 0.0])
            turned[side + upper] = _frames(first, np.cross(hinge, first)) @ _frames(first_rest, front).T
            turned[side + lower] = _frames(second, np.cross(hinge, second)) @ _frames(second_rest, front).T
        turned[side + "hand"], turned[side + "foot"] = turned[side + "forearm"], turned[side + "shank"]
    rotations = np.stack([turned[name] for name in SEGMENT_NAMES], 1)
    return Pose(_root(skeleton, joints, rotations), rotations)


def _trunk(joints: np.ndarray, bones: np.ndarray) -> dict[str, np.ndarray]:
    """Axes fixed to each segment of the trunk, as columns."""
    spine, head = bones[:, _AT["neck"]], bones[:, _AT["head"]]
    hips = joints[:, _AT["l_hip"]] - joints[:, _AT["r_hip"]]
    shoulders = joints[:, _AT["l_shoulder"]] - joints[:, _AT["r_shoulder"]]
    # The cross product of left and up is front.
    axes = {
        "pelvis": _frames(hips, np.cross(hips, spine)),
        "chest": _frames(spine, np.cross(shoulders, spine)),
        "head": _frames(head, np.cross(shoulders, head)),
    }
    front = axes["chest"][..., 1]
    return axes | {side + "clavicle": _frames(bones[:, _AT[side + "shoulder"]], front) for side in ("l_", "r_")}


def _facing(joints: np.ndarray) -> np.ndarray:
    """Front, left and up of an upright body, as columns."""
    left = (joints[0, _AT["l_hip"]] - joints[0, _AT["r_hip"]]) * [1.0, 1.0, 0.0]
    if np.linalg.norm(left) < 1e-6:
        raise ValueError("the motion has no left and right hip beside each other at rest; does its up axis hold?")
    left /= np.linalg.norm(left)
    up = np.array([0.0, 0.0, 1.0])
    return np.stack([np.cross(left, up), left, up], -1)


def _unit_bones(joints: np.ndarray, what: str) -> np.ndarray:
    """Unit direction of the bone that ends in each joint; zero for the pelvis."""
    vectors = joints - joints[:, [max(parent, 0) for parent in JOINT_PARENTS]]
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    short = lengths[:, 1:, 0] < 1e-6
    if short.any():
        frame, bone = (int(i) for i in np.argwhere(short)[0])
        names = JOINT_NAMES[1 + bone], JOINT_NAMES[JOINT_PARENTS[1 + bone]]
        raise ValueError(f"{names[0]} and {names[1]} are at the same place in frame {frame} of {what}")
    return vectors / np.maximum(lengths, 1e-9)


def _frames(along: np.ndarray, front: np.ndarray) -> np.ndarray:
    """Orthonormal axes as columns: along a bone, then the part of `front` that is perpendicular to the bone."""
    first = along / np.linalg.norm(along, axis=-1, keepdims=True)
    across = front - first * (first * front).sum(-1, keepdims=True)
    # If bone and front coincide, any perpendicular axis will do.
    spare = np.cross(first, np.eye(3)[np.abs(first).argmin(-1)])
    across = np.where(np.linalg.norm(across, axis=-1, keepdims=True) > 1e-6, across, spare)
    second = across / np.linalg.norm(across, axis=-1, keepdims=True)
    return np.stack([first, second, np.cross(first, second)], -1)


def _hinge(first: np.ndarray, second: np.ndarray, front: np.ndarray, bend: float) -> np.ndarray:
    """Axis ``a`` of a limb's hinge joint, such that the cross product of ``a`` and a bone is the bone's front.

    An elbow bends to the front of the arm (`bend` 1), a knee to the back of the leg (-1). A limb that is nearly
    straight, or seems bent the wrong way (as a straight leg does at the ball of its foot), takes its front from
    its parent instead.
    """
    by_parent = np.cross(first, front)
    by_bend = bend * np.cross(first, second)
    size = np.linalg.norm(by_bend, axis=-1, keepdims=True)
    if bend < 0:
        size = np.maximum((by_bend * by_parent).sum(-1, keepdims=True), 0.0)
    sure = np.minimum(size / _SURE_BEND, 1.0) ** 2
    return sure * by_bend / np.maximum(size, 1e-9) + (1.0 - sure) * by_parent


def _root(skeleton: Skeleton, joints: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """The path of the pelvis in the world (m)."""

    def leg(of: np.ndarray) -> float:
        # Bone lengths are constant, so the first frame is enough.
        ends = [of[0, [_AT[side + name] for name in ("hip", "knee", "foot")]] for side in ("l_", "r_")]
        return float(np.mean([np.linalg.norm(np.diff(end, axis=0), axis=-1).sum() for end in ends]))

    scale = leg(np.asarray(skeleton.rest_joints)[None]) / leg(joints)
    root = joints[:, 0] * scale
    placed, tips = place_joints(skeleton, Pose(np.zeros_like(root), rotations))
    feet, toes = [_AT["l_foot"], _AT["r_foot"]], [TIP_NAMES.index("l_toetip"), TIP_NAMES.index("r_toetip")]
    low = np.concatenate([np.asarray(placed)[:, feet, 2], np.asarray(tips)[:, toes, 2]], 1).min(1)
    captured = joints[:, feet, 2].min(1)
    root[:, 2] = (captured - captured.min()) * scale + TOE_CLEARANCE * skeleton.stature - low
    return root
