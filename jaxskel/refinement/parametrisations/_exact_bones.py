"""Joint rotations with the fewest unknowns that can move every joint."""

from functools import lru_cache
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..._math.rotations import perpendicular, turned
from ...body import FREE, Pose, Skeleton, SkeletonTemplate
from ._base import JointRotations


class ExactBones(JointRotations):
    """Joint rotations: bone lengths are exactly those of the template.

    Of a human 31 unknowns: 3 for the position of the pelvis (m), 3 each for the rotation of pelvis and chest, 2 for the
    direction of each other bone (rad), about axes perpendicular to the bone of the base pose. Hands and feet turn with
    forearms and shanks. Of any template, segments from which several bones branch off turn freely, because their twist
    moves joints; what lies beyond a pivot turns with the inner part of the bone.
    """

    def unknowns(self, skeleton: Skeleton) -> Float[Array, " unknowns"]:
        """The unknowns at the base pose: zeros."""
        layout = _layout(skeleton.template)
        return jnp.zeros(3 + 3 * len(layout.free) + 2 * len(layout.bones))

    def retract(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Pose:
        """The pose after a change by the unknowns."""
        layout = _layout(skeleton.template)
        free = unknowns[3 : 3 + 3 * len(layout.free)].reshape(-1, 3)
        across = unknowns[3 + 3 * len(layout.free) :].reshape(-1, 2)
        rest = jnp.concatenate([jnp.asarray(skeleton.rest_joints), jnp.asarray(skeleton.rest_tips)])
        offsets = rest[layout.ends] - rest[skeleton.template.point_parents[layout.ends]]
        rotations = jnp.asarray(base.rotations)
        bones = (rotations[layout.bones] * offsets[:, None]).sum(-1)
        first, second = perpendicular(bones / jnp.linalg.norm(bones, axis=-1, keepdims=True))
        turns = jnp.concatenate([free, across[:, :1] * first + across[:, 1:] * second])
        return Pose(base.root + unknowns[:3], turned(turns[layout.turns], rotations))


class _Layout(NamedTuple):
    """Which unknowns turn which segment.

    Attributes:
        free: Segments that turn freely.
        bones: Segments that turn with their bone.
        ends: Point at the end of each of these bones: an index into joints, then tips.
        turns: For each segment, the place of its turn among those of `free`, then `bones`.
    """

    free: Int[np.ndarray, " free"]
    bones: Int[np.ndarray, " bones"]
    ends: Int[np.ndarray, " bones"]
    turns: Int[np.ndarray, " segments"]


@lru_cache(maxsize=16)
def _layout(template: SkeletonTemplate) -> _Layout:
    segments, outer = range(len(template.segment_names)), set(template.segment_of_pivot)
    carriers = np.array(template.segment_of_joint + template.segment_of_tip)
    ends = {segment: int(np.argmax(carriers == segment)) for segment in segments if segment not in outer}
    parents = list(template.segment_parents)

    def branches(segment: int) -> bool:
        return segment == 0 or (template.freedoms[segment] == FREE and parents.count(segment) > 1)

    free = [segment for segment in ends if branches(segment)]
    bones = [segment for segment in ends if not branches(segment)]
    place = {segment: number for number, segment in enumerate(free + bones)}
    turns = [place[segment] if segment in place else place[parents[segment]] for segment in segments]
    # 32 bits, because JAX mixes up wider indices when float64 is switched on after the first use.
    return _Layout(*(np.array(rows, np.int32) for rows in (free, bones, [ends[bone] for bone in bones], turns)))
