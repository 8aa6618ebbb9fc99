"""How a pose is written as unknowns of a least squares problem, so that bone lengths hold."""

from typing import Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._rotations import exponential, turned
from ._skeleton import (
    JOINT_PARENTS,
    SEGMENT_NAMES,
    SEGMENT_OF_JOINT,
    SEGMENT_OF_PIVOT,
    SEGMENT_PARENTS,
    Pose,
    Skeleton,
    hinge_axes,
)

# The trunk turns freely, so that its twist can follow hips and shoulders; the twist of another bone moves no joint.
_FREE = (0, 1)
_BONES = tuple(range(2, 13))
# Hands and feet turn with forearms and shanks: the segments whose turn each segment takes.
_TURNS = (*range(13), *(SEGMENT_PARENTS[s] for s in SEGMENT_OF_PIVOT))
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
    direction of each other bone (rad), in the plane across the bone of the base pose. Hands and feet turn with
    forearms and shanks.
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
        rotations = jnp.asarray(base.rotations)
        bones = (rotations[np.array(_BONES)] * offsets[:, None]).sum(-1)
        first, second = _perpendicular(bones / jnp.linalg.norm(bones, axis=-1, keepdims=True))
        turns = jnp.concatenate([free, across[:, :1] * first + across[:, 1:] * second])
        return Pose(base.root + unknowns[:3], turned(turns[np.array(_TURNS)], rotations))


def _product(one: Float[Array, "n 3 3"], other: Float[Array, "n 3 3"]) -> Float[Array, "n 3 3"]:
    """Matrix products, written out: for matrices this small faster than, and in XLA for CPUs safer than, a dot."""
    return (one[:, :, :, None] * other[:, None]).sum(2)


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


# Shoulder blades and hands do not twist; elbows and knees are hinges; everything else turns freely.
_ACROSS = np.array([SEGMENT_NAMES.index(n) for n in ("l_clavicle", "r_clavicle", "l_hand", "r_hand")], np.int32)
_HINGES = np.array([SEGMENT_NAMES.index(n) for n in ("l_forearm", "r_forearm", "l_shank", "r_shank")], np.int32)
_HINGE_PARENTS = np.array(SEGMENT_PARENTS, np.int32)[_HINGES]
_TURNING = np.setdiff1d(np.arange(len(SEGMENT_NAMES), dtype=np.int32), np.concatenate([_ACROSS, _HINGES]))
_ORDER = np.argsort(np.concatenate([_TURNING, _ACROSS, _HINGES])).astype(np.int32)
# How many unknowns each segment has, and where they are.
_COUNTS = np.full(len(SEGMENT_NAMES), 3, np.int32)
_COUNTS[_ACROSS], _COUNTS[_HINGES] = 2, 1
_FREE_AT, _ACROSS_AT, _HINGES_AT = (
    (np.cumsum(_COUNTS) - _COUNTS)[group][:, None].astype(np.int32) + np.arange(int(_COUNTS[group[0]]), dtype=np.int32)
    for group in (_TURNING, _ACROSS, _HINGES)
)


def _levels() -> list[tuple[np.ndarray, np.ndarray]]:
    """Segments by the number of segments that they hang on, with their parents, from the trunk outwards."""
    depth = [0]
    for parent in SEGMENT_PARENTS[1:]:
        depth.append(depth[parent] + 1)
    levels = [np.flatnonzero(np.array(depth) == level).astype(np.int32) for level in range(1, max(depth) + 1)]
    return [(level, np.array(SEGMENT_PARENTS, np.int32)[level]) for level in levels]


def _hangs_on() -> Float[np.ndarray, "segments=17 segments=17"]:
    """Which segments each segment hangs on, itself among them."""
    chain = np.eye(len(SEGMENT_NAMES), dtype=np.float32)
    for segment, parent in enumerate(SEGMENT_PARENTS[1:], 1):
        chain[segment] += chain[parent]
    return chain


_LEVELS = _levels()
_HANGS_ON = _hangs_on()


class HingedLimbs(eqx.Module):
    """A chain of joints as a body has them: each segment turns relative to the one that it hangs on.

    42 unknowns: 3 for the position of the pelvis (m), then, segment by segment (rad), 3 for pelvis, chest, head, upper
    arms, thighs and feet, 2 across the bone for shoulder blades and hands, 1 for the flexion of elbows and knees. What
    the base pose has of a bend to the side in elbow or knee stays.
    """

    def unknowns(self) -> Float[Array, " unknowns"]:
        """The unknowns of the base pose: zeros."""
        return jnp.zeros(3 + int(_COUNTS.sum()))

    def pose(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Pose:
        """The pose that the unknowns stand for."""
        # What turns a segment turns all that hang on it.
        whole = exponential(self._turns(unknowns, base, skeleton))
        for level, parents in _LEVELS:
            whole = whole.at[level].set(_product(whole[parents], whole[level]))
        return Pose(base.root + unknowns[:3], _product(whole, jnp.asarray(base.rotations)))

    def nearby(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Pose:
        """The pose to first order: its derivative at zero is that of `pose`, at a fraction of the work."""
        turns = _HANGS_ON @ self._turns(unknowns, base, skeleton)
        rotations = jnp.asarray(base.rotations)
        turned = jnp.cross(turns[:, None], rotations.swapaxes(1, 2)).swapaxes(1, 2)
        return Pose(base.root + unknowns[:3], rotations + turned)

    def _turns(
        self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton
    ) -> Float[Array, "segments=17 3"]:
        """Rotation vector (rad) of each segment relative to the one it hangs on, in the world of the base pose."""
        rotations = jnp.asarray(base.rotations)
        rest, axes = jnp.asarray(skeleton.rest_joints), jnp.asarray(hinge_axes(skeleton))
        pivots = jnp.asarray(skeleton.pivots)
        bones = jnp.stack([rest[3] - rest[1], rest[6] - rest[1], rest[5] - pivots[0], rest[8] - pivots[1]])
        bones = jnp.einsum("bij,bj->bi", rotations[_ACROSS], bones)
        first, second = _perpendicular(bones / jnp.linalg.norm(bones, axis=-1, keepdims=True))
        hinges = jnp.einsum("hij,hj->hi", rotations[_HINGE_PARENTS], axes)
        free, across, flexion = (unknowns[3:][places] for places in (_FREE_AT, _ACROSS_AT, _HINGES_AT))
        turns = jnp.concatenate([free, across[:, :1] * first + across[:, 1:] * second, flexion * hinges])
        return turns[_ORDER]
