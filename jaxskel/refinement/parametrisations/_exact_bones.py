"""Joint rotations with the fewest unknowns that can move every joint."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._math.rotations import perpendicular, turned
from ...body import JOINT_PARENTS, SEGMENT_OF_JOINT, SEGMENT_OF_PIVOT, SEGMENT_PARENTS, Pose, Skeleton
from ._base import JointRotations

# Trunk segments turn freely, because their twist moves hips and shoulders; the twist of other bones moves no joint.
_FREE = (0, 1)
_BONES = tuple(range(2, 13))
# The segment whose rotation each segment takes: hands and feet turn with forearms and shanks.
_TURNS = (*range(13), *(SEGMENT_PARENTS[s] for s in SEGMENT_OF_PIVOT))
_JOINT_OF_BONE = tuple(SEGMENT_OF_JOINT.index(s) for s in _BONES)


class ExactBones(JointRotations):
    """Joint rotations: bone lengths are exactly those of the template.

    31 unknowns: 3 for the position of the pelvis (m), 3 each for the rotation of pelvis and chest, 2 for the
    direction of each other bone (rad), about axes perpendicular to the bone of the base pose. Hands and feet turn with
    forearms and shanks.
    """

    def unknowns(self) -> Float[Array, " unknowns"]:
        """The unknowns at the base pose: zeros."""
        return jnp.zeros(3 + 3 * len(_FREE) + 2 * len(_BONES))

    def retract(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Pose:
        """The pose after a change by the unknowns."""
        free = unknowns[3 : 3 + 3 * len(_FREE)].reshape(-1, 3)
        across = unknowns[3 + 3 * len(_FREE) :].reshape(-1, 2)
        joint = np.array(_JOINT_OF_BONE)
        rest = jnp.asarray(skeleton.rest_joints)
        offsets = rest[joint] - rest[np.array(JOINT_PARENTS)[joint]]
        rotations = jnp.asarray(base.rotations)
        bones = (rotations[np.array(_BONES)] * offsets[:, None]).sum(-1)
        first, second = perpendicular(bones / jnp.linalg.norm(bones, axis=-1, keepdims=True))
        turns = jnp.concatenate([free, across[:, :1] * first + across[:, 1:] * second])
        return Pose(base.root + unknowns[:3], turned(turns[np.array(_TURNS)], rotations))
