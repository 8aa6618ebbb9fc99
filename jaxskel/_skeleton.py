"""The template skeleton: 15 joints, 5 limb tips, known dimensions, forward kinematics.

A pose is a position of the pelvis and one rotation for each of 13 rigid *segments*. A segment moves the joints and
tips listed for it about its own proximal joint, so bone lengths are those of the template whatever the rotations.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

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
    "l_thigh", "l_shank", "r_thigh", "r_shank",
)  # fmt: skip
SEGMENT_PARENTS = (-1, 0, 1, 1, 3, 4, 1, 6, 7, 0, 9, 0, 11)
# The segment that carries the bone which ends in each joint: the hips turn with the pelvis.
SEGMENT_OF_JOINT = (0, 1, 2, 3, 4, 5, 6, 7, 8, 0, 9, 10, 0, 11, 12)
SEGMENT_OF_TIP = (2, 5, 8, 10, 12)

# Exchanges left and right.
MIRROR_JOINTS = (0, 1, 2, 6, 7, 8, 3, 4, 5, 12, 13, 14, 9, 10, 11)
MIRROR_TIPS = (0, 2, 1, 4, 3)


class Skeleton(eqx.Module):
    """The subject's known dimensions: joints and tips at rest.

    Body frame: x to the front, y to the left, z up, the pelvis at the origin, metres.
    """

    rest_joints: Float[Array | np.ndarray, "joints=15 3"]
    """Joints at rest (m), in the order of `JOINT_NAMES`."""
    rest_tips: Float[Array | np.ndarray, "tips=5 3"]
    """Limb tips at rest (m), in the order of `TIP_NAMES`."""

    @property
    def bone_lengths(self) -> Float[np.ndarray, "bones=14"]:
        """Length of the bone that ends in each joint but the pelvis (m)."""
        joints = np.asarray(self.rest_joints)
        return np.linalg.norm(joints[1:] - joints[list(JOINT_PARENTS[1:])], axis=-1)

    @property
    def tip_lengths(self) -> Float[np.ndarray, "tips=5"]:
        """Distance of each tip from its joint (m)."""
        joints, tips = np.asarray(self.rest_joints), np.asarray(self.rest_tips)
        return np.linalg.norm(tips - joints[list(TIP_PARENTS)], axis=-1)

    @property
    def stature(self) -> float:
        """Standing height (m): from the lower toe tip or ball of the foot to the top of the head."""
        joints, tips = np.asarray(self.rest_joints), np.asarray(self.rest_tips)
        return float(tips[0, 2] - min(tips[3:, 2].min(), joints[[11, 14], 2].min()))

    def scaled(self, factor: float) -> "Skeleton":
        """The same skeleton with every length multiplied by `factor`."""
        return Skeleton(self.rest_joints * factor, self.rest_tips * factor)


class Pose(eqx.Module):
    """Where the pelvis is and how each segment is turned, relative to the template at rest."""

    root: Float[Array | np.ndarray, "*frames 3"]
    """Pelvis in the world (m)."""
    rotations: Float[Array | np.ndarray, "*frames segments=13 3 3"]
    """Rotation of each segment from the body frame at rest to the world."""


def make_skeleton(rest_joints: np.ndarray, rest_tips: np.ndarray) -> Skeleton:
    """Check known dimensions and put the pelvis at the origin.

    Args:
        rest_joints: ``(15, 3)`` joints at rest (m): x to the front, y to the left, z up.
        rest_tips: ``(5, 3)`` limb tips at rest (m).

    Raises:
        ValueError: The arrays have other shapes, are not finite, or are not a person in metres.
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
    """Place joints and tips of one frame in the world (m). Bone lengths are those of the template exactly."""
    rest = jnp.asarray(skeleton.rest_joints)
    placed: list[Array] = [jnp.asarray(pose.root)]
    for joint in range(1, len(JOINT_NAMES)):
        parent = JOINT_PARENTS[joint]
        placed.append(placed[parent] + pose.rotations[SEGMENT_OF_JOINT[joint]] @ (rest[joint] - rest[parent]))
    joints = jnp.stack(placed)
    offsets = skeleton.rest_tips - rest[jnp.asarray(TIP_PARENTS)]
    turned = jnp.einsum("tij,tj->ti", jnp.asarray(pose.rotations)[jnp.asarray(SEGMENT_OF_TIP)], offsets)
    return joints, joints[jnp.asarray(TIP_PARENTS)] + turned


def default_adult(stature: float = 1.72) -> Skeleton:
    """An average adult of a given standing height (m).

    Joint centre distances in fractions of the stature: upper arm, forearm, half the palm, thigh, shank and the height
    of the seventh neck vertebra after de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters",
    J. Biomechanics 29 (1996), men; widths of shoulders and hips after Winter, *Biomechanics and Motor Control of
    Human Movement*. The arms hang 30 degrees away from the trunk.
    """
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
        "head": np.array([0.020, 0.0, 0.952]),
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
