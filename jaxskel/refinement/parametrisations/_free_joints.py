"""Free joint positions with residuals that hold the bone lengths."""

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
# The lengths held: those of the bones, and the distance between the hips.
_HELD_STARTS, _HELD_ENDS = np.append(_STARTS, np.int32(9)), np.append(_ENDS, np.int32(12))
# The line between two joints that each segment turns with: the hip line for the pelvis, the bone for hands and feet.
_LINES = np.array(
    [(12, 9), (0, 1), (1, 2), (1, 3), (3, 4), (4, 5), (1, 6), (6, 7), (7, 8), (9, 10), (10, 11), (12, 13), (13, 14),
     (4, 5), (7, 8), (10, 11), (13, 14)], np.int32
)  # fmt: skip
_TIP_JOINTS, _TIP_SEGMENTS = np.array(TIP_PARENTS, np.int32), np.array((2, 13, 14, 15, 16), np.int32)
# Wrists and ankles are placed relative to elbows and knees.
_PIVOT_JOINTS = np.array([JOINT_PARENTS[joint] for joint in JOINT_OF_PIVOT], np.int32)
_PIVOT_SEGMENTS = np.array((5, 8, 10, 12), np.int32)
# The joint about which each segment but hands and feet turns.
_ORIGIN_JOINTS = np.array((0, 0, 1, 1, 3, 4, 1, 6, 7, 9, 10, 12, 13), np.int32)


class JointPositions(eqx.Module):
    """Joint positions, segment rotations and Lagrange multipliers of one frame.

    Attributes:
        joints: (m, in the world)
        rotations: From the body frame at rest to the world.
        multipliers: Lagrange multipliers of the lengths, over twice their weight (m).
    """

    joints: Float[Array, "joints 3"]
    rotations: Float[Array, "segments 3 3"]
    multipliers: Float[Array, " lengths=15"]


class FreeJoints(eqx.Module):
    """Free joints, 45 unknowns (m); residuals hold the bone lengths: see `SoftBones` and `AugmentedLagrangian`.

    A segment turns with its bone by the least rotation. Joint positions do not determine twists, which stay those of
    the base.
    """

    weight: eqx.AbstractVar[Float[Array, ""]]

    @abstractmethod
    def settled(self, base: JointPositions, skeleton: Skeleton) -> JointPositions:
        """The base for the next round, computed after a solve."""

    def begin(self, pose: Pose, skeleton: Skeleton) -> JointPositions:
        """The joints of a pose, with multipliers of zero."""
        body = place(skeleton, pose)
        return JointPositions(body.joints, body.rotations, jnp.zeros(_COUNT, body.joints.dtype))

    def unknowns(self) -> Float[Array, " unknowns=45"]:
        """The unknowns at any base: zeros."""
        return jnp.zeros(3 * _COUNT)

    def retract(
        self, unknowns: Float[Array, " unknowns=45"], base: JointPositions, skeleton: Skeleton
    ) -> JointPositions:
        """The joints displaced by the unknowns, and the segments turned with their bones."""
        joints = base.joints + unknowns.reshape(-1, 3)
        before, after = (points[_LINES[:, 1]] - points[_LINES[:, 0]] for points in (base.joints, joints))
        return JointPositions(joints, _swung(_unit(before), _unit(after), base.rotations), base.multipliers)

    def placed(self, base: JointPositions, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world (m); tips keep their distances from their joints."""
        rest = jnp.asarray(skeleton.rest_joints)
        reach = jnp.asarray(skeleton.rest_tips) - rest[_TIP_JOINTS]
        tips = base.joints[_TIP_JOINTS] + jnp.einsum("tij,tj->ti", base.rotations[_TIP_SEGMENTS], reach)
        beyond = jnp.asarray(skeleton.pivots) - rest[_PIVOT_JOINTS]
        pivots = base.joints[_PIVOT_JOINTS] + jnp.einsum("pij,pj->pi", base.rotations[_PIVOT_SEGMENTS], beyond)
        origins = jnp.concatenate([base.joints[_ORIGIN_JOINTS], pivots])
        return PlacedBody(base.joints, tips, base.rotations, origins)

    def reached(self, unknowns: Float[Array, " unknowns"], base: JointPositions, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world (m) after a change by the unknowns."""
        return self.placed(self.retract(unknowns, base, skeleton), skeleton)

    def constraint_residuals(self, base: JointPositions, skeleton: Skeleton) -> dict[str, Float[Array, " lengths=15"]]:
        """Weighted differences of the lengths from the template's (m), shifted by the multipliers."""
        return {"bone_lengths": jnp.sqrt(self.weight) * (length_errors(base.joints, skeleton) + base.multipliers)}

    def pose(self, base: JointPositions, skeleton: Skeleton) -> Pose:
        """Pelvis position and segment rotations: bones of the template's lengths in the same directions."""
        return Pose(base.joints[0], base.rotations)


class SoftBones(FreeJoints):
    """Free joints with soft bone lengths: the weight decides how far they give way to the other terms.

    Attributes:
        weight: Weight of the squared error of a length (m^2): by default an error of 1 cm costs ten.
    """

    weight: Float[Array, ""] = eqx.field(converter=number, default=1e5)

    def settled(self, base: JointPositions, skeleton: Skeleton) -> JointPositions:
        """The same base: there are no multipliers to update."""
        return base


class AugmentedLagrangian(FreeJoints):
    """Free joints; multipliers, updated after each round, drive the length errors to zero (Hestenes, Powell).

    Each round removes most of the remaining error, so use more rounds than with the other parametrisations.

    Attributes:
        weight: Weight of the squared error of a length (m^2).
    """

    weight: Float[Array, ""] = eqx.field(converter=number, default=1e4)

    def settled(self, base: JointPositions, skeleton: Skeleton) -> JointPositions:
        """Add the remaining length errors to the multipliers."""
        multipliers = base.multipliers + length_errors(base.joints, skeleton)
        return JointPositions(base.joints, base.rotations, multipliers)


def length_errors(joints: Float[Array, "joints 3"], skeleton: Skeleton) -> Float[Array, " lengths=15"]:
    """Actual minus template length (m) of the bones, in the order of their joints, and of the hip distance."""
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
    """Rotations followed by the least rotation that takes one unit vector to the other."""
    axis, cosine = cross(before, after), (before * after).sum(-1)[:, None]
    # For opposite vectors the least rotation is not unique; a solver's steps stay far from this case.
    share = 1 / jnp.maximum(1 + cosine, 1e-6)
    columns = (rotations[..., column] for column in range(3))
    once = ((column, cross(axis, column)) for column in columns)
    return jnp.stack([column + turn + share * cross(axis, turn) for column, turn in once], -1)
