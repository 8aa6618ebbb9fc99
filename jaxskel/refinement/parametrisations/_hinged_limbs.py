"""Joint rotations with the degrees of freedom of the template: those of a human body, for example."""

from functools import lru_cache, partial, reduce
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float, Int

from ..._math.rotations import exponential, left_jacobian, perpendicular
from ...body import ACROSS, FREE, HINGE, Pose, Skeleton, SkeletonTemplate, hinge_axes
from ..terms import PlacedBody
from ._base import JointRotations
from ._motion import Motion


class HingedLimbs(JointRotations):
    """Joint rotations: each segment turns relative to its parent, as far as its joint lets it; bone lengths are exact.

    Of a human 42 unknowns: 3 for the position of the pelvis (m), then, segment by segment (rad), 3 for pelvis, chest,
    head, upper arms, thighs and feet, 2 across the bone for shoulder blades and hands, 1 for the flexion of elbows and
    knees. A sideways bend of elbow or knee in the base pose stays as it is.
    """

    def unknowns(self, skeleton: Skeleton) -> Float[Array, " unknowns"]:
        """The unknowns at the base pose: zeros."""
        return jnp.zeros(3 + len(_layout(skeleton.template).axes))

    def retract(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Pose:
        """The pose after a change by the unknowns."""
        # A segment's rotation also rotates its descendants.
        turned = exponential(self._turns(unknowns, base, skeleton))
        chains = jnp.concatenate([turned, jnp.eye(3, dtype=turned.dtype)[None]])[_layout(skeleton.template).chains]
        return Pose(base.root + unknowns[:3], reduce(_product, [*chains, jnp.asarray(base.rotations)]))

    def nearby(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Pose:
        """First-order approximation of `retract`: the same derivative at zero at a fraction of the cost."""
        turns = skeleton.template.hangs_on @ self._turns(unknowns, base, skeleton)
        rotations = jnp.asarray(base.rotations)
        turned = jnp.cross(turns[:, None], rotations.swapaxes(1, 2)).swapaxes(1, 2)
        return Pose(base.root + unknowns[:3], rotations + turned)

    def reached(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world (m) after a change by the unknowns."""
        return _reached(unknowns, base, skeleton)

    def motion(self, base: Pose, placed: PlacedBody, skeleton: Skeleton) -> Motion:
        """Derivative of the base pose by each unknown; `placed` is the placed base pose."""
        return self._motion(self._units(base, skeleton), placed, skeleton.template)

    def motion_at(
        self, unknowns: Float[Array, " unknowns"], base: Pose, placed: PlacedBody, skeleton: Skeleton
    ) -> Motion:
        """Derivative by each unknown at the pose that the unknowns lead to; `placed` is that pose, placed."""
        about = left_jacobian(self._turns(unknowns, base, skeleton))
        # The rotation of a segment's parent also rotates the segment's axes.
        rotations, before = jnp.asarray(placed.rotations), jnp.asarray(base.rotations)
        whole = _product(rotations, before.swapaxes(1, 2))[np.array(skeleton.template.segment_parents[1:], np.int32)]
        about = jnp.concatenate([about[:1], _product(whole, about[1:])])
        segments = _layout(skeleton.template).segments
        turns = (about[segments] * self._units(base, skeleton)[:, None]).sum(-1)
        return self._motion(turns, placed, skeleton.template)

    def _motion(self, turns: Float[Array, "turning 3"], placed: PlacedBody, template: SkeletonTemplate) -> Motion:
        segments, hangs_on = _layout(template).segments, template.hangs_on
        return Motion(
            turns=jnp.concatenate([jnp.zeros((3, 3)), turns]),
            pivots=jnp.concatenate([jnp.zeros((3, 3)), placed.origins[segments]]),
            shifts=np.eye(3 + len(segments), 3, dtype=np.float32),
            moves=np.concatenate([np.zeros((3, len(hangs_on)), np.float32), hangs_on[:, segments].T]),
        )

    def _units(self, base: Pose, skeleton: Skeleton) -> Float[Array, "turning 3"]:
        """Axis of each rotational unknown, in the world of the base pose."""
        first, second, hinges = self._axes(base, skeleton)
        return jnp.concatenate([jnp.eye(3), first, second, hinges])[_layout(skeleton.template).axes]

    def _turns(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Float[Array, "segments 3"]:
        """Rotation vector (rad) of each segment relative to its parent, in the world of the base pose."""
        first, second, hinges = self._axes(base, skeleton)
        layout = _layout(skeleton.template)
        free, across, flexion = (unknowns[3:][places] for places in layout.places)
        turns = jnp.concatenate([free, across[:, :1] * first + across[:, 1:] * second, flexion * hinges])
        return turns[layout.order]

    def _axes(
        self, base: Pose, skeleton: Skeleton
    ) -> tuple[Float[Array, "across 3"], Float[Array, "across 3"], Float[Array, "hinges 3"]]:
        """World axes: two across the bones of the segments that do not twist, and those of the hinges."""
        layout, rotations = _layout(skeleton.template), jnp.asarray(base.rotations)
        rest, axes = jnp.asarray(skeleton.rest_joints), jnp.asarray(hinge_axes(skeleton))
        points = jnp.concatenate([rest, jnp.asarray(skeleton.pivots), jnp.asarray(skeleton.rest_tips)])
        bones = points[layout.across_ends] - points[skeleton.template.origins[layout.across]]
        bones = jnp.einsum("bij,bj->bi", rotations[layout.across], bones)
        first, second = perpendicular(bones / jnp.linalg.norm(bones, axis=-1, keepdims=True))
        return first, second, jnp.einsum("hij,hj->hi", rotations[layout.hinge_parents], axes[layout.hinges])


class _Layout(NamedTuple):
    """Which unknowns turn which segment, about which axes.

    Attributes:
        across: Segments that turn across their bone only.
        across_ends: Where their bones end: an index into joints, then pivots, then tips.
        hinges: For each segment that is a hinge's, the number of that hinge.
        hinge_parents: The segments that they turn against.
        places: The unknowns, without the translation, of segments that turn freely, across, and as hinges.
        order: Permutation from those three groups to the segments.
        axes: Axis of each unknown: world axes, then first and second axes across the bones, then hinge axes.
        segments: Segment of each unknown.
        chains: What turns each segment: the segments from the trunk outwards to it, after as many times the number of
            segments, which stands for no turn, as make all chains equally long.
    """

    across: Int[np.ndarray, " across"]
    across_ends: Int[np.ndarray, " across"]
    hinges: Int[np.ndarray, " hinges"]
    hinge_parents: Int[np.ndarray, " hinges"]
    places: tuple[Int[np.ndarray, "_ _"], ...]
    order: Int[np.ndarray, " segments"]
    axes: Int[np.ndarray, " turning"]
    segments: Int[np.ndarray, " turning"]
    chains: Int[np.ndarray, "longest segments"]


@lru_cache(maxsize=16)
def _layout(template: SkeletonTemplate) -> _Layout:
    # 32 bits, here and below, because JAX mixes up wider indices when float64 is switched on after the first use.
    counts = np.array(template.freedoms, np.int32)
    parents = np.array(template.segment_parents, np.int32)
    groups = [np.flatnonzero(counts == freedom).astype(np.int32) for freedom in (FREE, ACROSS, HINGE)]
    first = (np.cumsum(counts) - counts).astype(np.int32)
    places = tuple(
        first[group][:, None] + np.arange(freedom, dtype=np.int32)
        for group, freedom in zip(groups, (FREE, ACROSS, HINGE), strict=True)
    )
    across, hinges = groups[1], groups[2]
    axes = np.empty(int(counts.sum()), np.int32)
    axes[places[0]] = np.arange(3)
    axes[places[1]] = 3 + np.arange(2 * len(across)).reshape(2, -1).T
    axes[places[2][:, 0]] = 3 + 2 * len(across) + np.arange(len(hinges))
    joints, pivots = len(template.joint_names), len(template.pivots)
    carriers = template.segments_of_points.tolist()
    ends = [carriers.index(segment) for segment in across.tolist()]
    of_segment = [hinge.segment for hinge in template.hinges]
    chains = [[0]]
    for segment, parent in enumerate(template.segment_parents[1:], 1):
        chains.append([*chains[parent], segment])
    longest = max(map(len, chains))
    filled = [[len(chains)] * (longest - len(chain)) + chain for chain in chains]
    return _Layout(
        across,
        np.array([end if end < joints else end + pivots for end in ends], np.int32),
        np.array([of_segment.index(segment) for segment in hinges.tolist()], np.int32),
        parents[hinges],
        places,
        np.argsort(np.concatenate(groups)).astype(np.int32),
        axes,
        np.repeat(np.arange(len(counts), dtype=np.int32), counts),
        np.array(filled, np.int32).T,
    )


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
