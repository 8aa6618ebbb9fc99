"""How a pose is written as unknowns of a least squares problem, so that bone lengths hold."""

from typing import Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._rotations import exponential
from ._skeleton import JOINT_PARENTS, SEGMENT_NAMES, SEGMENT_OF_JOINT, Pose, Skeleton

# The trunk turns freely, so that its twist can follow hips and shoulders; the twist of another bone moves no joint.
_FREE = (0, 1)
_BONES = tuple(range(2, len(SEGMENT_NAMES)))
_JOINT_OF_BONE = tuple(SEGMENT_OF_JOINT.index(s) for s in _BONES)


@runtime_checkable
class Parametrisation(Protocol):
    """Writes the pose of one frame relative to a base pose; zero unknowns are the base pose itself."""

    def unknowns(self) -> Float[Array, " unknowns"]:
        """The unknowns of the base pose: zeros."""
        ...

    def pose(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Pose:
        """The pose that the unknowns stand for."""
        ...


class ExactBones(eqx.Module):
    """Joint rotations: bone lengths are exactly those of the template.

    31 unknowns: 3 for the position of the pelvis (m), 3 each for the rotation of pelvis and chest, 2 for the
    direction of each other bone (rad), in the plane across the bone of the base pose.
    """

    def unknowns(self) -> Float[Array, " unknowns"]:
        """The unknowns of the base pose: zeros."""
        return jnp.zeros(3 + 3 * len(_FREE) + 2 * len(_BONES))

    def pose(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Pose:
        """The pose that the unknowns stand for."""
        free = unknowns[3 : 3 + 3 * len(_FREE)].reshape(-1, 3)
        across = unknowns[3 + 3 * len(_FREE) :].reshape(-1, 2)
        joint = np.array(_JOINT_OF_BONE)
        rest = jnp.asarray(skeleton.rest_joints)
        offsets = rest[joint] - rest[np.array(JOINT_PARENTS)[joint]]
        bones = jnp.einsum("sij,sj->si", base.rotations[np.array(_BONES)], offsets)
        first, second = _perpendicular(bones / jnp.linalg.norm(bones, axis=-1, keepdims=True))
        turns = jnp.concatenate([free, across[:, :1] * first + across[:, 1:] * second])
        return Pose(base.root + unknowns[:3], exponential(turns) @ base.rotations)


def _perpendicular(direction: Float[Array, "n 3"]) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"]]:
    """Two unit vectors across each unit vector (Duff et al. 2017, without the branch)."""
    x, y, z = direction.T
    sign = jnp.where(z >= 0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (
        jnp.stack([1.0 + sign * x * x * a, sign * b, -sign * x], -1),
        jnp.stack([b, sign + y * y * a, -y], -1),
    )
