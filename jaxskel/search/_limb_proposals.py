"""Proposals of other limbs for batches of poses: the cheapest entries of tables of limb poses."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from .._runtime.compile_cache import cached_jit
from ..body import Pose
from ..refinement.terms import Observed
from ._limb_search import Limb, Scored, best_pairs, best_single, score_limb, unexplained, with_limb, without
from ._model import Model

# The limb search uses one in this many rays, to save time.
_SOME = 2


@cached_jit
def with_pairs(
    model: Model,
    poses: Pose,
    frames: Int[Array | np.ndarray, " n"],
    stack: Observed,
    names: tuple[str, str],
    count: int,
) -> Pose:
    """Replace two limbs of each pose by their cheapest pairs of table poses (axes ``n count``)."""
    limbs = tuple(model.limbs[name] for name in names)
    both, rest = jax.tree.map(lambda *each: jnp.stack(each), *limbs), without(*names)
    objective = model.objective.of_body(model.body)

    def one(pose: Pose, frame: Int[Array, ""]) -> Pose:
        some = stack.of(frame).thinned(_SOME)
        points, costs = unexplained(model.body, pose, objective, some, rest)

        # A loop over the limbs: they are compiled once.
        def scored(limb: Limb) -> Scored:
            return score_limb(model.body, pose, objective, some, limb, points, costs)

        scores = jax.lax.map(scored, both)
        left, right = (jax.tree.map(lambda a, i=i: a[i], scores) for i in (0, 1))
        first, second = best_pairs(left, right, count)
        return jax.vmap(lambda i, j: with_limb(with_limb(pose, limbs[0], i), limbs[1], j))(first, second)

    return jax.vmap(one)(poses, jnp.asarray(frames))


@cached_jit
def with_single(
    model: Model, poses: Pose, frames: Int[Array | np.ndarray, " n"], stack: Observed, limb: Limb, count: int
) -> Pose:
    """Replace one limb of each pose by its cheapest table poses (axes ``n count``)."""
    objective = model.objective.of_body(model.body)

    def one(pose: Pose, frame: Int[Array, ""]) -> Pose:
        some = stack.of(frame).thinned(_SOME)
        points, costs = unexplained(model.body, pose, objective, some, limb.others)
        scored = score_limb(model.body, pose, objective, some, limb, points, costs)
        return jax.vmap(lambda index: with_limb(pose, limb, index))(best_single(scored, count))

    return jax.vmap(one)(poses, jnp.asarray(frames))
