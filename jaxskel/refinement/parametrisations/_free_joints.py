"""Free joint positions with residuals that hold the bone lengths."""

from abc import abstractmethod
from functools import lru_cache
from itertools import combinations

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..._math.rotations import cross
from ...body import Pose, Skeleton, SkeletonTemplate
from ..terms import PlacedBody, number, place


class JointPositions(eqx.Module):
    """Joint positions, segment rotations and Lagrange multipliers of one frame.

    Attributes:
        joints: (m, in the world)
        rotations: From the body frame at rest to the world.
        multipliers: Lagrange multipliers of the lengths, over twice their weight (m).
    """

    joints: Float[Array, "joints 3"]
    rotations: Float[Array, "segments 3 3"]
    multipliers: Float[Array, " lengths"]


class FreeJoints(eqx.Module):
    """Free joints, three unknowns each (m); residuals hold the lengths: see `SoftBones` and `AugmentedLagrangian`.

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
        return JointPositions(body.joints, body.rotations, jnp.zeros(len(_held(skeleton.template)), body.joints.dtype))

    def unknowns(self, skeleton: Skeleton) -> Float[Array, " unknowns"]:
        """The unknowns at any base: zeros."""
        return jnp.zeros(3 * len(skeleton.template.joint_names))

    def retract(self, unknowns: Float[Array, " unknowns"], base: JointPositions, skeleton: Skeleton) -> JointPositions:
        """The joints displaced by the unknowns, and the segments turned with their bones."""
        joints, lines = base.joints + unknowns.reshape(-1, 3), _lines(skeleton.template)
        before, after = (points[lines[:, 1]] - points[lines[:, 0]] for points in (base.joints, joints))
        return JointPositions(joints, _swung(_unit(before), _unit(after), base.rotations), base.multipliers)

    def placed(self, base: JointPositions, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world (m); tips keep their distances from their joints."""
        rest, template = jnp.asarray(skeleton.rest_joints), skeleton.template
        tip_joints = template.point_parents[len(rest) :]
        reach = jnp.asarray(skeleton.rest_tips) - rest[tip_joints]
        tip_segments = np.array(template.segment_of_tip, np.int32)
        tips = base.joints[tip_joints] + jnp.einsum("tij,tj->ti", base.rotations[tip_segments], reach)
        # Wrists and ankles are placed relative to elbows and knees.
        ends = np.array([pivot.joint for pivot in template.pivots], np.int32)
        starts, inner = template.point_parents[ends], np.array(template.segment_of_joint, np.int32)[ends]
        beyond = jnp.asarray(skeleton.pivots) - rest[starts]
        pivots = base.joints[starts] + jnp.einsum("pij,pj->pi", base.rotations[inner], beyond)
        origins = jnp.concatenate([base.joints, pivots])[template.origins]
        return PlacedBody(base.joints, tips, base.rotations, origins, template)

    def reached(self, unknowns: Float[Array, " unknowns"], base: JointPositions, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world (m) after a change by the unknowns."""
        return self.placed(self.retract(unknowns, base, skeleton), skeleton)

    def constraint_residuals(self, base: JointPositions, skeleton: Skeleton) -> dict[str, Float[Array, " lengths"]]:
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


def length_errors(joints: Float[Array, "joints 3"], skeleton: Skeleton) -> Float[Array, " lengths"]:
    """Actual minus template length (m) of the bones, in the order of their joints, then within rigid segments.

    A segment with several joints keeps their distances: of a human, the one between the hips.
    """
    starts, ends = _held(skeleton.template).T
    rest = jnp.asarray(skeleton.rest_joints)
    lengths, expected = (jnp.sqrt(((points[ends] - points[starts]) ** 2).sum(-1)) for points in (joints, rest))
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


@lru_cache(maxsize=16)
def _held(template: SkeletonTemplate) -> Int[np.ndarray, "lengths 2"]:
    """Joints at both ends of the lengths that are held."""
    bones = [(parent, joint) for joint, parent in enumerate(template.joint_parents) if joint]
    carried = [np.flatnonzero(np.array(template.segment_of_joint) == s) for s in range(len(template.segment_names))]
    # The root is at the start of its segment's bones, not at an end of one.
    pairs = [pair for own in carried for pair in combinations(own[own > 0].tolist(), 2)]
    return np.array(bones + pairs, np.int32)


@lru_cache(maxsize=16)
def _lines(template: SkeletonTemplate) -> Int[np.ndarray, "segments 2"]:
    """The joints at both ends of the line that each segment turns with.

    That is its bone, from right to left where the first segment carries a pair, and the parent's line for segments
    that carry no joint.
    """
    at = {segment: pivot.joint for pivot, segment in zip(template.pivots, template.segment_of_pivot, strict=True)}
    lines: list[tuple[int, int]] = []
    for segment, parent in enumerate(template.segment_parents):
        own = [j for j, carrier in enumerate(template.segment_of_joint) if carrier == segment and j]
        pairs = [(int(template.mirror_joints[j]), j) for j in own if template.joint_names[j].startswith("l_")]
        joint = at.get(segment, own[0] if own else -1)
        if segment == 0 and pairs and pairs[0][0] in own:
            lines.append(pairs[0])
        elif joint > 0:
            lines.append((template.joint_parents[joint], joint))
        else:
            lines.append(lines[parent] if parent >= 0 else (0, template.joint_parents.index(0)))
    return np.array(lines, np.int32)
