"""A skeleton: a template with known dimensions, its pose, and forward kinematics.

A pose is a position of the root, the pelvis of a human, and one rotation for each rigid segment. A segment moves its
joints and tips about its own origin, so lengths are those at rest whatever the rotations.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._runtime.kinds import check_number
from ._human import HUMAN_15, JOINT_NAMES, TIP_NAMES
from ._template import SkeletonTemplate

# GPUs round numbers to ten bits otherwise, and lengths would not be those at rest.
_EXACT = jax.lax.Precision.HIGHEST


class Skeleton(eqx.Module):
    """The subject's known dimensions: joints and tips at rest.

    Body frame: x to the front, y to the left, z up, the root joint at the origin, metres.

    Attributes:
        rest_joints: Joints at rest (m), in the order of the template.
        rest_tips: Limb tips at rest (m), in the order of the template.
        template: What the skeleton consists of: by default the paper's human.
    """

    rest_joints: Float[Array | np.ndarray, "joints 3"]
    rest_tips: Float[Array | np.ndarray, "tips 3"]
    template: SkeletonTemplate = eqx.field(static=True, default=HUMAN_15)

    @property
    def bone_lengths(self) -> Float[np.ndarray, " bones"]:
        """Length of the bone that ends in each joint except the root (m)."""
        joints = np.asarray(self.rest_joints)
        return np.linalg.norm(joints[1:] - joints[self.template.point_parents[1 : len(joints)]], axis=-1)

    @property
    def tip_lengths(self) -> Float[np.ndarray, " tips"]:
        """Distance of each tip from its joint (m)."""
        joints, tips = np.asarray(self.rest_joints), np.asarray(self.rest_tips)
        return np.linalg.norm(tips - joints[list(self.template.tip_parents)], axis=-1)

    @property
    def pivots(self) -> Float[Array | np.ndarray, "pivots 3"]:
        """Points inside bones at rest (m): wrists and ankles of the human template."""
        joints, pivots = self.rest_joints, self.template.pivots
        xp = joints.__array_namespace__()
        ends = np.array([pivot.joint for pivot in pivots], np.int32)
        starts = self.template.point_parents[ends]
        share, shift = (
            xp.asarray(np.array([pivot[field] for pivot in pivots]).reshape(-1, 3), dtype=joints.dtype)
            for field in (2, 3)
        )
        return joints[ends] + share * (joints[starts] - joints[ends]) + shift * self.height

    @property
    def height(self) -> Float[Array | np.ndarray | np.floating, ""]:
        """Standing height (m): from the lower toe tip or ball of the foot to the top of the head.

        Of any template, from the tips that describe inner joints, and the joints beside them, to the first tip.
        """
        joints, tips = self.rest_joints, self.rest_tips
        xp, low = joints.__array_namespace__(), [tip for tip in self.template.described_by if tip > 0]
        feet, balls = (np.array(rows, np.int32) for rows in (low, [self.template.tip_parents[tip] for tip in low]))
        return tips[0, 2] - xp.minimum(tips[feet, 2].min(), joints[balls, 2].min())

    @property
    def stature(self) -> float:
        """Standing height (m) as a plain number, which cannot be differentiated."""
        return float(self.height)

    @property
    def size(self) -> float:
        """The largest extent of joints and tips at rest, along an axis (m): of a standing human, nearly the stature."""
        points = np.concatenate([np.asarray(self.rest_joints), np.asarray(self.rest_tips)])
        return float(np.ptp(points, axis=0).max())

    def scaled(self, factor: float) -> "Skeleton":
        """The same skeleton with every length multiplied by `factor`."""
        return Skeleton(self.rest_joints * factor, self.rest_tips * factor, self.template)


def stretched(skeleton: Skeleton, factors: Float[Array, " bones"]) -> Skeleton:
    """Scale the bone that ends in each joint except the root, and the joint's tip, by the joint's factor."""
    rest, template = jnp.asarray(skeleton.rest_joints), skeleton.template
    starts, tip_joints = template.point_parents[1 : len(rest)], template.point_parents[len(rest) :]
    offsets = (rest[1:] - rest[starts]) * factors[:, None]
    reach = (jnp.asarray(skeleton.rest_tips) - rest[tip_joints]) * factors[tip_joints - 1, None]
    joints = template.bones_to @ offsets + rest[:1]
    return Skeleton(joints, joints[tip_joints] + reach, template)


class Pose(eqx.Module):
    """Position of the root and rotation of each segment, relative to the skeleton at rest.

    Attributes:
        root: Root joint, the pelvis of a human, in the world (m).
        rotations: Rotation of each segment from the body frame at rest to the world.
    """

    root: Float[Array | np.ndarray, "*frames 3"]
    rotations: Float[Array | np.ndarray, "*frames segments 3 3"]


def make_skeleton(rest_joints: Any, rest_tips: Any, template: SkeletonTemplate = HUMAN_15) -> Skeleton:
    """Check known dimensions and put the root at the origin.

    Args:
        rest_joints: ``(joints, 3)`` joints at rest (m): x to the front, y to the left, z up.
        rest_tips: ``(tips, 3)`` limb tips at rest (m).
        template: What the skeleton consists of.

    Raises:
        ValueError: The arrays have wrong shapes, are not finite, or do not describe a person in metres.
    """
    joints, tips = np.asarray(rest_joints, np.float64), np.asarray(rest_tips, np.float64)
    wanted = (len(template.joint_names), 3), (len(template.tip_names), 3)
    if (joints.shape, tips.shape) != wanted:
        raise ValueError(
            f"rest_joints must be {wanted[0]} and rest_tips {wanted[1]}, not {joints.shape} and {tips.shape}"
        )
    if not (np.isfinite(joints).all() and np.isfinite(tips).all()):
        raise ValueError("rest_joints or rest_tips hold NaN or infinity: measure the subject again")
    skeleton = Skeleton(joints - joints[0], tips - joints[0], template)
    if template == HUMAN_15 and not 0.4 < skeleton.stature < 2.8:
        raise ValueError(
            f"rest_joints and rest_tips span {skeleton.stature:.2f} m from toe to head: give metres, z up, standing"
        )
    least, told = (0.01, "1 cm") if template == HUMAN_15 else (1e-3 * skeleton.size, "a thousandth of the whole")
    if skeleton.bone_lengths.min() < least:
        bone = template.joint_names[1 + int(skeleton.bone_lengths.argmin())]
        raise ValueError(f"rest_joints: the bone that ends in {bone} is shorter than {told}")
    return skeleton


def forward_kinematics(skeleton: Skeleton, pose: Pose) -> tuple[Float[Array, "joints 3"], Float[Array, "tips 3"]]:
    """Place joints and tips of one frame in the world (m). Lengths are those at rest exactly."""
    joints, tips, _ = place_segments(skeleton, pose)
    return joints, tips


def place_segments(
    skeleton: Skeleton, pose: Pose
) -> tuple[Float[Array, "joints 3"], Float[Array, "tips 3"], Float[Array, "segments 3"]]:
    """Place joints, tips, and the point that each segment turns about, of one frame in the world (m)."""
    template, rest, rotations = skeleton.template, jnp.asarray(skeleton.rest_joints), jnp.asarray(pose.rotations)
    points = jnp.concatenate([rest, jnp.asarray(skeleton.pivots)])
    starts, ends, segments = template.parts.T
    turned = jnp.einsum("pij,pj->pi", rotations[segments], points[ends] - points[starts], precision=_EXACT)
    placed = jnp.asarray(pose.root)[None] + jnp.matmul(template.parts_to, turned, precision=_EXACT)
    joints, tip_joints = placed[: len(rest)], template.point_parents[len(rest) :]
    offsets = skeleton.rest_tips - rest[tip_joints]
    carriers = np.array(template.segment_of_tip, np.int32)
    tips = joints[tip_joints] + jnp.einsum("tij,tj->ti", rotations[carriers], offsets, precision=_EXACT)
    return joints, tips, placed[template.origins]


def rest_origins(skeleton: Skeleton) -> Float[Array | np.ndarray, "segments 3"]:
    """The point that each segment turns about, at rest (m, body frame)."""
    joints = skeleton.rest_joints
    return joints.__array_namespace__().concatenate([joints, skeleton.pivots])[skeleton.template.origins]


def hinge_axes(skeleton: Skeleton) -> Float[Array | np.ndarray, "hinges 3"]:
    """Unit axes of the template's hinges at rest (body frame): positive angles bend to where the hinge bends to.

    Each is perpendicular to the upper bone and to that direction.
    """
    joints, hinges = skeleton.rest_joints, skeleton.template.hinges
    xp = joints.__array_namespace__()
    ends = np.array([hinge.joint for hinge in hinges], np.int32)
    upper = joints[ends] - joints[skeleton.template.point_parents[ends]]
    bends_to = np.array([hinge.bends_to for hinge in hinges], np.float32).reshape(-1, 3)
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
