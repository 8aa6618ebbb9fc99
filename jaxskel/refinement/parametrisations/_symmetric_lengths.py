"""Free bone lengths that are the same on the left and on the right."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ...body import Pose, Skeleton, SkeletonTemplate, stretched
from ..terms import PlacedBody, number, place
from ._base import JointRotations
from ._exact_bones import ExactBones


class StretchedPose(eqx.Module):
    """A pose with bone lengths that differ from the template's.

    Attributes:
        stretch: Logarithm of each length over the template's; left and right share one.
    """

    pose: Pose
    stretch: Float[Array, " lengths"]


class SymmetricLengths(eqx.Module):
    """Joint rotations and lengths shared by left and right, for a template that is only nearly the subject's.

    The unknowns are those of `rotations` (m, rad), then the logarithms of the lengths over those of the base.

    Attributes:
        weight: Weight of the squared logarithm: by default a length that is 5 % off costs 0.1.
    """

    rotations: JointRotations = ExactBones()
    weight: Float[Array, ""] = eqx.field(converter=number, default=40.0)

    def begin(self, pose: Pose, skeleton: Skeleton) -> StretchedPose:
        """The pose with the template's own lengths."""
        return StretchedPose(self.rotations.begin(pose, skeleton), jnp.zeros(_count(skeleton)))

    def unknowns(self, skeleton: Skeleton) -> Float[Array, " unknowns"]:
        """The unknowns at any base: zeros."""
        return jnp.concatenate([self.rotations.unknowns(skeleton), jnp.zeros(_count(skeleton))])

    def retract(self, unknowns: Float[Array, " unknowns"], base: StretchedPose, skeleton: Skeleton) -> StretchedPose:
        """The pose and the lengths after a change by the unknowns."""
        turns, stretch = jnp.split(unknowns, [len(unknowns) - _count(skeleton)])
        pose = self.rotations.retract(turns, base.pose, self._template(base, skeleton))
        return StretchedPose(pose, base.stretch + stretch)

    def placed(self, base: StretchedPose, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world (m)."""
        return place(self._template(base, skeleton), base.pose)

    def reached(self, unknowns: Float[Array, " unknowns"], base: StretchedPose, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world (m) after a change by the unknowns."""
        return self.placed(self.retract(unknowns, base, skeleton), skeleton)

    def constraint_residuals(self, base: StretchedPose, skeleton: Skeleton) -> dict[str, Float[Array, " lengths"]]:
        """Weighted logarithms of the lengths over the template's."""
        return {"bone_lengths": jnp.sqrt(self.weight) * base.stretch}

    def settled(self, base: StretchedPose, skeleton: Skeleton) -> StretchedPose:
        """The same base."""
        return base

    def pose(self, base: StretchedPose, skeleton: Skeleton) -> Pose:
        """Pelvis position and segment rotations: bones of the template's lengths in the same directions."""
        return base.pose

    def _template(self, base: StretchedPose, skeleton: Skeleton) -> Skeleton:
        return stretched(skeleton, jnp.exp(base.stretch)[_length_of_bone(skeleton.template)])


def _count(skeleton: Skeleton) -> int:
    return int(_length_of_bone(skeleton.template).max()) + 1


def _length_of_bone(template: SkeletonTemplate) -> Int[np.ndarray, " bones"]:
    """The length that each bone has: left and right share one."""
    names = [name.removeprefix("l_").removeprefix("r_") for name in template.joint_names[1:]]
    return np.array([list(dict.fromkeys(names)).index(name) for name in names], np.int32)
