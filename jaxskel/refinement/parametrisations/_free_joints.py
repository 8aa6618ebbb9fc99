"""Joints that move freely, and bones that pull them to their lengths."""

from abc import abstractmethod

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._math.rotations import cross
from ...body import JOINT_OF_PIVOT, JOINT_PARENTS, TIP_PARENTS, Pose, Skeleton
from ..terms import PlacedBody, number, place

_COUNT = len(JOINT_PARENTS)
_ENDS = np.arange(1, _COUNT, dtype=np.int32)
_STARTS = np.array(JOINT_PARENTS[1:], np.int32)
# Bones, and the two hips, which a pelvis keeps apart.
_HELD_STARTS, _HELD_ENDS = np.append(_STARTS, np.int32(9)), np.append(_ENDS, np.int32(12))
# The line that each segment turns with, from joint to joint: the pelvis with the hips, hands and feet with their bones.
_LINES = np.array(
    [(12, 9), (0, 1), (1, 2), (1, 3), (3, 4), (4, 5), (1, 6), (6, 7), (7, 8), (9, 10), (10, 11), (12, 13), (13, 14),
     (4, 5), (7, 8), (10, 11), (13, 14)], np.int32
)  # fmt: skip
_TIP_JOINTS, _TIP_SEGMENTS = np.array(TIP_PARENTS, np.int32), np.array((2, 13, 14, 15, 16), np.int32)
# Wrists and ankles hang on elbows and knees.
_PIVOT_JOINTS = np.array([JOINT_PARENTS[joint] for joint in JOINT_OF_PIVOT], np.int32)
_PIVOT_SEGMENTS = np.array((5, 8, 10, 12), np.int32)
# The joint that each segment but hands and feet turns about.
_ORIGIN_JOINTS = np.array((0, 0, 1, 1, 3, 4, 1, 6, 7, 9, 10, 12, 13), np.int32)


class JointPositions(eqx.Module):
    """Where the joints of one frame are, how the segments are turned, and how the bones pull."""

    joints: Float[Array, "joints=15 3"]
    """(m)"""
    rotations: Float[Array, "segments=17 3 3"]
    """From the body frame at rest to the world."""
    multipliers: Float[Array, " lengths=15"]
    """Lagrange multipliers of the lengths, over twice their weight (m)."""


class FreeJoints(eqx.Module):
    """Joints that move freely, 45 unknowns (m), while residuals hold the lengths of the bones: see its two kinds.

    A segment turns with its bone by the least rotation; twists, which no joint shows, stay those of the base.
    """

    weight: eqx.AbstractVar[Float[Array, ""]]

    @abstractmethod
    def settled(self, base: JointPositions, skeleton: Skeleton) -> JointPositions:
        """The base for the next round, after a solve."""

    def begin(self, pose: Pose, skeleton: Skeleton) -> JointPositions:
        """The joints of a pose."""
        body = place(skeleton, pose)
        return JointPositions(body.joints, body.rotations, jnp.zeros(_COUNT, body.joints.dtype))

    def unknowns(self) -> Float[Array, " unknowns=45"]:
        """The unknowns of any base: zeros."""
        return jnp.zeros(3 * _COUNT)

    def retract(
        self, unknowns: Float[Array, " unknowns=45"], base: JointPositions, skeleton: Skeleton
    ) -> JointPositions:
        """The joints displaced, the segments turned with their bones."""
        joints = base.joints + unknowns.reshape(-1, 3)
        before, after = (points[_LINES[:, 1]] - points[_LINES[:, 0]] for points in (base.joints, joints))
        return JointPositions(joints, _swung(_unit(before), _unit(after), base.rotations), base.multipliers)

    def placed(self, base: JointPositions, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world; tips keep their distances from their joints."""
        rest = jnp.asarray(skeleton.rest_joints)
        reach = jnp.asarray(skeleton.rest_tips) - rest[_TIP_JOINTS]
        tips = base.joints[_TIP_JOINTS] + jnp.einsum("tij,tj->ti", base.rotations[_TIP_SEGMENTS], reach)
        beyond = jnp.asarray(skeleton.pivots) - rest[_PIVOT_JOINTS]
        pivots = base.joints[_PIVOT_JOINTS] + jnp.einsum("pij,pj->pi", base.rotations[_PIVOT_SEGMENTS], beyond)
        origins = jnp.concatenate([base.joints[_ORIGIN_JOINTS], pivots])
        return PlacedBody(base.joints, tips, base.rotations, origins)

    def reached(self, unknowns: Float[Array, " unknowns"], base: JointPositions, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world that the unknowns lead to."""
        return self.placed(self.retract(unknowns, base, skeleton), skeleton)

    def constraint_residuals(self, base: JointPositions, skeleton: Skeleton) -> dict[str, Float[Array, " lengths=15"]]:
        """Weighted differences of the lengths from the template's, shifted by the multipliers."""
        return {"bone_lengths": jnp.sqrt(self.weight) * (length_errors(base.joints, skeleton) + base.multipliers)}

    def pose(self, base: JointPositions, skeleton: Skeleton) -> Pose:
        """Pelvis and rotations: bones of the template's lengths in the same directions."""
        return Pose(base.joints[0], base.rotations)


class SoftBones(FreeJoints):
    """Free joints; lengths are as soft as their weight says, and give way to what pulls harder."""

    weight: Float[Array, ""] = eqx.field(converter=number, default=1e5)
    """Of the squared error of a length (m^2): by default a centimetre costs ten."""

    def settled(self, base: JointPositions, skeleton: Skeleton) -> JointPositions:
        """The same base."""
        return base


class AugmentedLagrangian(FreeJoints):
    """Free joints; multipliers, updated after each round, drive the errors of the lengths to zero (Hestenes, Powell).

    Each round takes away most of the error that is left: give it more of them than the other parametrisations.
    """

    weight: Float[Array, ""] = eqx.field(converter=number, default=1e4)
    """Of the squared error of a length (m^2)."""

    def settled(self, base: JointPositions, skeleton: Skeleton) -> JointPositions:
        """What is left of the errors is pulled at from now on."""
        multipliers = base.multipliers + length_errors(base.joints, skeleton)
        return JointPositions(base.joints, base.rotations, multipliers)


def length_errors(joints: Float[Array, "joints=15 3"], skeleton: Skeleton) -> Float[Array, " lengths=15"]:
    """By how much the bones, in the order of their joints, and the distance of the hips are too long (m)."""
    rest = jnp.asarray(skeleton.rest_joints)
    lengths, expected = (
        jnp.sqrt(((points[_HELD_ENDS] - points[_HELD_STARTS]) ** 2).sum(-1)) for points in (joints, rest)
    )
    return lengths - expected


def _unit(vectors: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
    return vectors / jnp.sqrt((vectors * vectors).sum(-1)[:, None])


def _swung(
    before: Float[Array, "n 3"], after: Float[Array, "n 3"], rotations: Float[Array, "n 3 3"]
) -> Float[Array, "n 3 3"]:
    """Rotations turned further by the least rotation that takes one unit vector to the other."""
    axis, cosine = cross(before, after), (before * after).sum(-1)[:, None]
    # Of opposite vectors any rotation is the least; a solver's step never comes near.
    share = 1 / jnp.maximum(1 + cosine, 1e-6)
    columns = (rotations[..., column] for column in range(3))
    once = ((column, cross(axis, column)) for column in columns)
    return jnp.stack([column + turn + share * cross(axis, turn) for column, turn in once], -1)
