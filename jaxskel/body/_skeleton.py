"""The template skeleton (the paper's G', Fig. 2a): 15 joints, 5 limb tips, known dimensions, forward kinematics.

A pose is a position of the pelvis and one rotation for each of 17 rigid *segments*. A segment moves its joints and tips
about its own origin, so lengths are those of the template whatever the rotations. Wrists and ankles are not joints but
pivots inside the bones that end in palm and ball of the foot: these two bones are rigid as long as hand and foot turn
with forearm and shank.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._runtime.kinds import check_number

JOINT_NAMES = (
    "pelvis", "neck", "head",
    "l_shoulder", "l_elbow", "l_hand", "r_shoulder", "r_elbow", "r_hand",
    "l_hip", "l_knee", "l_foot", "r_hip", "r_knee", "r_foot",
)  # fmt: skip
JOINT_PARENTS = (-1, 0, 1, 1, 3, 4, 1, 6, 7, 0, 9, 10, 0, 12, 13)
TIP_NAMES = ("head_top", "l_fingertip", "r_fingertip", "l_toetip", "r_toetip")
TIP_PARENTS = (2, 5, 8, 11, 14)

SEGMENT_NAMES = (
    "pelvis", "chest", "head", "l_clavicle", "l_upper_arm", "l_forearm", "r_clavicle", "r_upper_arm", "r_forearm",
    "l_thigh", "l_shank", "r_thigh", "r_shank", "l_hand", "r_hand", "l_foot", "r_foot",
)  # fmt: skip
SEGMENT_PARENTS = (-1, 0, 1, 1, 3, 4, 1, 6, 7, 0, 9, 0, 11, 5, 8, 10, 12)
# The segment that carries the bone ending in each joint: the hips turn with the pelvis.
SEGMENT_OF_JOINT = (0, 1, 2, 3, 4, 5, 6, 7, 8, 0, 9, 10, 0, 11, 12)
SEGMENT_OF_TIP = (2, 13, 14, 15, 16)
PIVOT_NAMES = ("l_wrist", "r_wrist", "l_ankle", "r_ankle")
# The joint beyond each pivot and the segment that carries it there.
JOINT_OF_PIVOT = (5, 8, 11, 14)
SEGMENT_OF_PIVOT = (13, 14, 15, 16)

# The joint that each segment except the last four turns about: the start of the bones that it carries. Indices have 32
# bits, because JAX confuses wider ones if float64 is switched on after the first use.
_ORIGIN_JOINTS = np.array(
    [JOINT_PARENTS[SEGMENT_OF_JOINT.index(s, 1)] for s in range(len(SEGMENT_NAMES) - 4)], np.int32
)
_TIP_JOINTS, _TIP_SEGMENTS = np.array(TIP_PARENTS, np.int32), np.array(SEGMENT_OF_TIP, np.int32)
_BALLS_OF_FEET = np.array([11, 14], np.int32)
_PIVOT_BONES = np.array([[4, 7], [5, 8], [10, 13], [11, 14]], np.int32)  # elbows, palms, knees, balls of the feet

# Rigid parts of the skeleton: start and end (index into joints, then pivots) and segment. A bone with a pivot has two.
_PARTS = tuple(
    part
    for joint in range(1, len(JOINT_NAMES))
    for part in (
        (
            (JOINT_PARENTS[joint], 15 + JOINT_OF_PIVOT.index(joint), SEGMENT_OF_JOINT[joint]),
            (15 + JOINT_OF_PIVOT.index(joint), joint, SEGMENT_OF_PIVOT[JOINT_OF_PIVOT.index(joint)]),
        )
        if joint in JOINT_OF_PIVOT
        else ((JOINT_PARENTS[joint], joint, SEGMENT_OF_JOINT[joint]),)
    )
)
_PART_STARTS, _PART_ENDS, _PART_SEGMENTS = np.array(_PARTS, np.int32).T


def _parts_to() -> Float[np.ndarray, "points=19 parts=18"]:
    """Indicator matrix of the parts on the path from the pelvis to each joint and pivot."""
    ways = np.zeros((19, len(_PARTS)), np.float32)
    for number, (start, end, _) in enumerate(_PARTS):
        ways[end] = ways[start]
        ways[end, number] = 1
    return ways


_PARTS_TO = _parts_to()

_BONE_STARTS = np.array(JOINT_PARENTS[1:], np.int32)


def _bones_to() -> Float[np.ndarray, "joints=15 bones=14"]:
    """Indicator matrix of the bones on the path from the pelvis to each joint."""
    ways = np.zeros((len(JOINT_NAMES), len(JOINT_NAMES) - 1), np.float32)
    for joint in range(1, len(JOINT_NAMES)):
        ways[joint] = ways[JOINT_PARENTS[joint]]
        ways[joint, joint - 1] = 1
    return ways


_BONES_TO = _bones_to()

# Permutations that exchange left and right.
MIRROR_JOINTS = (0, 1, 2, 6, 7, 8, 3, 4, 5, 12, 13, 14, 9, 10, 11)
MIRROR_TIPS = (0, 2, 1, 4, 3)


class Skeleton(eqx.Module):
    """The subject's known dimensions: joints and tips at rest.

    Body frame: x to the front, y to the left, z up, the pelvis at the origin, metres.

    Attributes:
        rest_joints: Joints at rest (m), in the order of `JOINT_NAMES`.
        rest_tips: Limb tips at rest (m), in the order of `TIP_NAMES`.
    """

    rest_joints: Float[Array | np.ndarray, "joints=15 3"]
    rest_tips: Float[Array | np.ndarray, "tips=5 3"]

    @property
    def bone_lengths(self) -> Float[np.ndarray, "bones=14"]:
        """Length of the bone that ends in each joint except the pelvis (m)."""
        joints = np.asarray(self.rest_joints)
        return np.linalg.norm(joints[1:] - joints[list(JOINT_PARENTS[1:])], axis=-1)

    @property
    def tip_lengths(self) -> Float[np.ndarray, "tips=5"]:
        """Distance of each tip from its joint (m)."""
        joints, tips = np.asarray(self.rest_joints), np.asarray(self.rest_tips)
        return np.linalg.norm(tips - joints[list(TIP_PARENTS)], axis=-1)

    @property
    def pivots(self) -> Float[Array | np.ndarray, "pivots=4 3"]:
        """Wrists and ankles at rest (m), in the order of `PIVOT_NAMES`.

        The wrist is 0.29 of the way from the palm, the middle of the hand, to the elbow (de Leva 1996). The ankle is
        behind and above the ball of the foot, by 0.071 and 0.027 of the stature (Winter).
        """
        joints, height = self.rest_joints, self.height
        xp = joints.__array_namespace__()
        elbows, palms, knees, balls = (joints[_PIVOT_BONES[row]] for row in range(4))
        ankles = xp.stack(
            [balls[:, 0] - 0.071 * height, (knees[:, 1] + 3 * balls[:, 1]) / 4, balls[:, 2] + 0.027 * height], -1
        )
        return xp.concatenate([palms + 0.29 * (elbows - palms), ankles])

    @property
    def height(self) -> Float[Array | np.ndarray | np.floating, ""]:
        """Standing height (m): from the lower toe tip or ball of the foot to the top of the head."""
        joints, tips = self.rest_joints, self.rest_tips
        xp = joints.__array_namespace__()
        return tips[0, 2] - xp.minimum(tips[3:, 2].min(), joints[_BALLS_OF_FEET, 2].min())

    @property
    def stature(self) -> float:
        """Standing height (m) as a plain number, which cannot be differentiated."""
        return float(self.height)

    def scaled(self, factor: float) -> "Skeleton":
        """The same skeleton with every length multiplied by `factor`."""
        return Skeleton(self.rest_joints * factor, self.rest_tips * factor)


def stretched(skeleton: Skeleton, factors: Float[Array, "bones=14"]) -> Skeleton:
    """Scale the bone that ends in each joint except the pelvis, and the joint's tip, by the joint's factor."""
    rest = jnp.asarray(skeleton.rest_joints)
    offsets = (rest[1:] - rest[_BONE_STARTS]) * factors[:, None]
    reach = (jnp.asarray(skeleton.rest_tips) - rest[_TIP_JOINTS]) * factors[_TIP_JOINTS - 1, None]
    joints = _BONES_TO @ offsets + rest[:1]
    return Skeleton(joints, joints[_TIP_JOINTS] + reach)


class Pose(eqx.Module):
    """Position of the pelvis and rotation of each segment, relative to the template at rest.

    Attributes:
        root: Pelvis in the world (m).
        rotations: Rotation of each segment from the body frame at rest to the world.
    """

    root: Float[Array | np.ndarray, "*frames 3"]
    rotations: Float[Array | np.ndarray, "*frames segments=17 3 3"]


def make_skeleton(rest_joints: np.ndarray, rest_tips: np.ndarray) -> Skeleton:
    """Check known dimensions and put the pelvis at the origin.

    Args:
        rest_joints: ``(15, 3)`` joints at rest (m): x to the front, y to the left, z up.
        rest_tips: ``(5, 3)`` limb tips at rest (m).

    Raises:
        ValueError: The arrays have wrong shapes, are not finite, or do not describe a person in metres.
    """
    joints, tips = np.asarray(rest_joints, np.float64), np.asarray(rest_tips, np.float64)
    if joints.shape != (15, 3) or tips.shape != (5, 3):
        raise ValueError(f"rest_joints must be (15, 3) and rest_tips (5, 3), not {joints.shape} and {tips.shape}")
    if not (np.isfinite(joints).all() and np.isfinite(tips).all()):
        raise ValueError("rest_joints or rest_tips hold NaN or infinity: measure the subject again")
    skeleton = Skeleton(joints - joints[0], tips - joints[0])
    if not 0.4 < skeleton.stature < 2.8:
        raise ValueError(
            f"rest_joints and rest_tips span {skeleton.stature:.2f} m from toe to head: give metres, z up, standing"
        )
    if skeleton.bone_lengths.min() < 0.01:
        bone = JOINT_NAMES[1 + int(skeleton.bone_lengths.argmin())]
        raise ValueError(f"rest_joints: the bone that ends in {bone} is shorter than 1 cm")
    return skeleton


def forward_kinematics(skeleton: Skeleton, pose: Pose) -> tuple[Float[Array, "joints=15 3"], Float[Array, "tips=5 3"]]:
    """Place joints and tips of one frame in the world (m). Lengths are those of the template exactly."""
    joints, tips, _ = place_segments(skeleton, pose)
    return joints, tips


def place_segments(
    skeleton: Skeleton, pose: Pose
) -> tuple[Float[Array, "joints=15 3"], Float[Array, "tips=5 3"], Float[Array, "segments=17 3"]]:
    """Place joints, tips, and the point that each segment turns about, of one frame in the world (m)."""
    rest, rotations = jnp.asarray(skeleton.rest_joints), jnp.asarray(pose.rotations)
    points = jnp.concatenate([rest, jnp.asarray(skeleton.pivots)])
    parts = points[_PART_ENDS] - points[_PART_STARTS]
    turned = jnp.einsum("pij,pj->pi", rotations[_PART_SEGMENTS], parts)
    placed = jnp.asarray(pose.root)[None] + _PARTS_TO @ turned
    joints, pivots = placed[: len(JOINT_NAMES)], placed[len(JOINT_NAMES) :]
    offsets = skeleton.rest_tips - rest[_TIP_JOINTS]
    tips = joints[_TIP_JOINTS] + jnp.einsum("tij,tj->ti", rotations[_TIP_SEGMENTS], offsets)
    return joints, tips, jnp.concatenate([joints[_ORIGIN_JOINTS], pivots])


def rest_origins(skeleton: Skeleton) -> Float[Array | np.ndarray, "segments=17 3"]:
    """The point that each segment turns about, at rest (m, body frame)."""
    joints = skeleton.rest_joints
    return joints.__array_namespace__().concatenate([joints[_ORIGIN_JOINTS], skeleton.pivots])


def hinge_axes(skeleton: Skeleton) -> Float[Array | np.ndarray, "hinges=4 3"]:
    """Unit axes of elbows and knees at rest (body frame): positive angles bend elbows to the front, knees to the back.

    Each is perpendicular to the upper bone and to the front.
    """
    joints = skeleton.rest_joints
    xp = joints.__array_namespace__()
    upper = joints[np.array([4, 7, 10, 13], np.int32)] - joints[np.array([3, 6, 9, 12], np.int32)]
    bends_to = np.array([[1.0, 0, 0], [1.0, 0, 0], [-1.0, 0, 0], [-1.0, 0, 0]], np.float32)
    axes = xp.linalg.cross(upper, xp.asarray(bends_to))
    return axes / xp.linalg.vector_norm(axes, axis=-1, keepdims=True)


def default_adult(stature: float = 1.72) -> Skeleton:
    """An average adult of a given standing height (m).

    Joint distances are fractions of the stature: upper arm, forearm, half the palm, thigh, shank and the height
    of the seventh neck vertebra after de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters",
    J. Biomechanics 29 (1996), men; widths of shoulders and hips after Winter, *Biomechanics and Motor Control of
    Human Movement*. The middle of the head is as far below its top as in the man and the woman of
    [`make_body`][jaxskel.make_body]. The arms hang 30 degrees away from the trunk.
    """
    check_number("stature", stature, 0.0, np.inf, "a height in metres, such as 1.72")
    arm = np.array([0.0, np.sin(np.pi / 6), -np.cos(np.pi / 6)])
    side = {"shoulder": np.array([0.0, 0.105, 0.810]), "hip": np.array([0.0, 0.052, 0.525])}
    side["elbow"] = side["shoulder"] + 0.162 * arm
    side["hand"] = side["elbow"] + 0.179 * arm
    side["fingertip"] = side["hand"] + 0.075 * arm
    side["knee"] = side["hip"] + np.array([0.0, 0.010, -0.2425])
    side["foot"] = np.array([0.070, 0.070, 0.016])
    side["toetip"] = np.array([0.105, 0.075, 0.008])
    middle = {
        "pelvis": np.array([0.0, 0.0, 0.525]),
        "neck": np.array([0.0, 0.0, 0.8605]),
        "head": np.array([0.020, 0.0, 0.956]),
        "head_top": np.array([0.022, 0.0, 1.0]),
    }

    def place(name: str) -> np.ndarray:
        if name in middle:
            return middle[name]
        return side[name[2:]] * (np.array([1, 1, 1]) if name[0] == "l" else np.array([1, -1, 1]))

    joints = np.stack([place(n) for n in JOINT_NAMES])
    tips = np.stack([place(n) for n in TIP_NAMES])
    lowest = tips[3, 2]
    factor = stature / (1.0 - lowest)
    return make_skeleton((joints - [0, 0, lowest]) * factor, (tips - [0, 0, lowest]) * factor)
