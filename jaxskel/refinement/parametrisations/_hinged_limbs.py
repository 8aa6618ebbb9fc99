"""Joint rotations with the degrees of freedom of a human body."""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from ..._math.rotations import exponential, left_jacobian, perpendicular
from ...body import SEGMENT_NAMES, SEGMENT_PARENTS, Pose, Skeleton, hinge_axes
from ..terms import PlacedBody
from ._base import JointRotations
from ._motion import Motion

# Shoulder blades and hands do not twist; elbows and knees are hinges; all other segments turn freely.
_ACROSS = np.array([SEGMENT_NAMES.index(n) for n in ("l_clavicle", "r_clavicle", "l_hand", "r_hand")], np.int32)
_HINGES = np.array([SEGMENT_NAMES.index(n) for n in ("l_forearm", "r_forearm", "l_shank", "r_shank")], np.int32)
_HINGE_PARENTS = np.array(SEGMENT_PARENTS, np.int32)[_HINGES]
_TURNING = np.setdiff1d(np.arange(len(SEGMENT_NAMES), dtype=np.int32), np.concatenate([_ACROSS, _HINGES]))
_ORDER = np.argsort(np.concatenate([_TURNING, _ACROSS, _HINGES])).astype(np.int32)
# Number of unknowns of each segment, and their indices.
_COUNTS = np.full(len(SEGMENT_NAMES), 3, np.int32)
_COUNTS[_ACROSS], _COUNTS[_HINGES] = 2, 1
_FREE_AT, _ACROSS_AT, _HINGES_AT = (
    (np.cumsum(_COUNTS) - _COUNTS)[group][:, None].astype(np.int32) + np.arange(int(_COUNTS[group[0]]), dtype=np.int32)
    for group in (_TURNING, _ACROSS, _HINGES)
)


def _levels() -> list[tuple[np.ndarray, np.ndarray]]:
    """Segments with their parents, grouped by depth in the kinematic tree, from the trunk outwards."""
    depth = [0]
    for parent in SEGMENT_PARENTS[1:]:
        depth.append(depth[parent] + 1)
    levels = [np.flatnonzero(np.array(depth) == level).astype(np.int32) for level in range(1, max(depth) + 1)]
    return [(level, np.array(SEGMENT_PARENTS, np.int32)[level]) for level in levels]


def _hangs_on() -> Float[np.ndarray, "segments segments"]:
    """One where a segment (row) equals or descends from another (column), else zero."""
    chain = np.eye(len(SEGMENT_NAMES), dtype=np.float32)
    for segment, parent in enumerate(SEGMENT_PARENTS[1:], 1):
        chain[segment] += chain[parent]
    return chain


def _axis_of_each() -> np.ndarray:
    """Axis of each unknown: world axes, then first and second axes across the bones, then hinge axes."""
    axes = np.empty(int(_COUNTS.sum()), np.int32)
    axes[_FREE_AT] = np.arange(3)
    axes[_ACROSS_AT] = 3 + np.arange(2 * len(_ACROSS)).reshape(2, -1).T
    axes[_HINGES_AT[:, 0]] = 3 + 2 * len(_ACROSS) + np.arange(len(_HINGES))
    return axes


_LEVELS = _levels()
_HANGS_ON = _hangs_on()
# For each unknown but the first three (the translation): its axis and its segment.
_AXES = _axis_of_each()
_SEGMENTS = np.repeat(np.arange(len(_COUNTS), dtype=np.int32), _COUNTS)


class HingedLimbs(JointRotations):
    """Joint rotations of a human body: each segment turns relative to its parent; bone lengths are exact.

    42 unknowns: 3 for the position of the pelvis (m), then, segment by segment (rad), 3 for pelvis, chest, head, upper
    arms, thighs and feet, 2 across the bone for shoulder blades and hands, 1 for the flexion of elbows and knees. A
    sideways bend of elbow or knee in the base pose stays as it is.
    """

    def unknowns(self) -> Float[Array, " unknowns"]:
        """The unknowns at the base pose: zeros."""
        return jnp.zeros(3 + int(_COUNTS.sum()))

    def retract(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Pose:
        """The pose after a change by the unknowns."""
        # A segment's rotation also rotates its descendants.
        whole = exponential(self._turns(unknowns, base, skeleton))
        for level, parents in _LEVELS:
            whole = whole.at[level].set(_product(whole[parents], whole[level]))
        return Pose(base.root + unknowns[:3], _product(whole, jnp.asarray(base.rotations)))

    def nearby(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Pose:
        """First-order approximation of `retract`: the same derivative at zero at a fraction of the cost."""
        turns = _HANGS_ON @ self._turns(unknowns, base, skeleton)
        rotations = jnp.asarray(base.rotations)
        turned = jnp.cross(turns[:, None], rotations.swapaxes(1, 2)).swapaxes(1, 2)
        return Pose(base.root + unknowns[:3], rotations + turned)

    def reached(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world (m) after a change by the unknowns."""
        return _reached(unknowns, base, skeleton)

    def motion(self, base: Pose, placed: PlacedBody, skeleton: Skeleton) -> Motion:
        """Derivative of the base pose by each unknown; `placed` is the placed base pose."""
        return self._motion(self._units(base, skeleton), placed)

    def motion_at(
        self, unknowns: Float[Array, " unknowns"], base: Pose, placed: PlacedBody, skeleton: Skeleton
    ) -> Motion:
        """Derivative by each unknown at the pose that the unknowns lead to; `placed` is that pose, placed."""
        about = left_jacobian(self._turns(unknowns, base, skeleton))
        # The rotation of a segment's parent also rotates the segment's axes.
        rotations, before = jnp.asarray(placed.rotations), jnp.asarray(base.rotations)
        whole = _product(rotations, before.swapaxes(1, 2))[np.array(SEGMENT_PARENTS[1:], np.int32)]
        about = jnp.concatenate([about[:1], _product(whole, about[1:])])
        return self._motion((about[_SEGMENTS] * self._units(base, skeleton)[:, None]).sum(-1), placed)

    def _motion(self, turns: Float[Array, "turning 3"], placed: PlacedBody) -> Motion:
        return Motion(
            turns=jnp.concatenate([jnp.zeros((3, 3)), turns]),
            pivots=jnp.concatenate([jnp.zeros((3, 3)), placed.origins[_SEGMENTS]]),
            shifts=np.eye(3 + len(_SEGMENTS), 3, dtype=np.float32),
            moves=np.concatenate([np.zeros((3, len(_HANGS_ON)), np.float32), _HANGS_ON[:, _SEGMENTS].T]),
        )

    def _units(self, base: Pose, skeleton: Skeleton) -> Float[Array, "turning 3"]:
        """Axis of each rotational unknown, in the world of the base pose."""
        first, second, hinges = self._axes(base, skeleton)
        return jnp.concatenate([jnp.eye(3), first, second, hinges])[_AXES]

    def _turns(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Float[Array, "segments 3"]:
        """Rotation vector (rad) of each segment relative to its parent, in the world of the base pose."""
        first, second, hinges = self._axes(base, skeleton)
        free, across, flexion = (unknowns[3:][places] for places in (_FREE_AT, _ACROSS_AT, _HINGES_AT))
        turns = jnp.concatenate([free, across[:, :1] * first + across[:, 1:] * second, flexion * hinges])
        return turns[_ORDER]

    def _axes(
        self, base: Pose, skeleton: Skeleton
    ) -> tuple[Float[Array, "across=4 3"], Float[Array, "across=4 3"], Float[Array, "hinges=4 3"]]:
        """World axes: two across the bones of shoulder blades and hands each, and those of the hinges."""
        rotations = jnp.asarray(base.rotations)
        rest, axes = jnp.asarray(skeleton.rest_joints), jnp.asarray(hinge_axes(skeleton))
        pivots = jnp.asarray(skeleton.pivots)
        bones = jnp.stack([rest[3] - rest[1], rest[6] - rest[1], rest[5] - pivots[0], rest[8] - pivots[1]])
        bones = jnp.einsum("bij,bj->bi", rotations[_ACROSS], bones)
        first, second = perpendicular(bones / jnp.linalg.norm(bones, axis=-1, keepdims=True))
        return first, second, jnp.einsum("hij,hj->hi", rotations[_HINGE_PARENTS], axes)


def _traced(unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> PlacedBody:
    return JointRotations.reached(HingedLimbs(), unknowns, base, skeleton)


_reached = jax.custom_jvp(_traced)


@partial(_reached.defjvp, symbolic_zeros=True)
def _reached_tangent(primals: Any, tangents: Any) -> tuple[PlacedBody, PlacedBody]:
    """The derivative by the unknowns in closed form, in a seventh of the time of differentiating the chain."""
    (unknowns, base, skeleton), (change, *others) = primals, tangents
    body = _reached(unknowns, base, skeleton)
    tangent = jax.tree.map(jnp.zeros_like, body)
    if not isinstance(change, SymbolicZero):
        effects = HingedLimbs().motion_at(unknowns, base, body, skeleton).of_body(body)
        tangent = jax.tree.map(lambda effect: effect @ change, effects)
    if not all(isinstance(leaf, SymbolicZero) for leaf in jax.tree.leaves(others)):
        others = jax.tree.map(_as_array, tuple(others))
        _, rest = jax.jvp(partial(_traced, unknowns), (base, skeleton), others)
        tangent = jax.tree.map(jnp.add, tangent, rest)
    return body, tangent


def _as_array(tangent: Any) -> Array:
    if not isinstance(tangent, SymbolicZero):
        return tangent
    kind: Any = tangent.aval
    return jnp.zeros(kind.shape, kind.dtype)


def _product(one: Float[Array, "n 3 3"], other: Float[Array, "n 3 3"]) -> Float[Array, "n 3 3"]:
    """Matrix products, written out: for small matrices faster than a dot, and safer in XLA for CPUs."""
    return (one[:, :, :, None] * other[:, None]).sum(2)
