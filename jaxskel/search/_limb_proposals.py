"""Proposals of other limbs for batches of poses: the cheapest entries of tables of limb poses."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from .._runtime.compile_cache import cached_jit
from ..body import Pose
from ..refinement.terms import Observed
from ._limb_search import Scored, best_pairs, none_scored, score_limb, unexplained, with_limb, without
from ._model import Model

# The limb search uses one in this many rays, to save time.
_SOME = 2
BOTH = np.array([0, 1], np.int32)
"""Replace both limbs of a pair."""


def only(number: int) -> Int[np.ndarray, "2"]:
    """Replace only this limb of a pair: written as the same number twice, so that one program serves both."""
    return np.full(2, number, np.int32)


@cached_jit
def with_limbs(
    model: Model,
    poses: Pose,
    frames: Int[Array | np.ndarray, " n"],
    stack: Observed,
    names: tuple[str, str],
    which: Int[Array | np.ndarray, "2"],
    count: int,
) -> Pose:
    """Replace one or two limbs of each pose by their cheapest table poses (axes ``n count``).

    One program serves both, because it takes seconds to compile.

    Args:
        model: The body and its tables.
        poses: Poses of which other limbs are replaced.
        frames: The frame of each pose in the stack.
        stack: What the frames show.
        names: A left and a right limb.
        which: `BOTH`, or `only` one of them.
        count: Number of proposals for each pose.
    """
    which = jnp.asarray(which)
    alone = which[0] == which[1]
    limbs = jax.tree.map(lambda *each: jnp.stack(each)[which], *(model.limbs[name] for name in names))
    first, second = (jax.tree.map(lambda a, i=i: a[i], limbs) for i in (0, 1))
    others = [without(*names), *(without(name) for name in names)]
    longest = max(map(len, others))
    # A capsule given twice changes nothing.
    padded = np.stack([np.pad(some, (0, longest - len(some)), mode="edge") for some in others])
    rest = jnp.asarray(padded)[jnp.where(alone, 1 + which[0], 0)]
    objective = model.objective.of_body(model.body)

    def one(pose: Pose, frame: Int[Array, ""]) -> Pose:
        some = stack.of(frame).thinned(_SOME)
        points, costs = unexplained(model.body, pose, objective, some, rest)

        # A loop over the limbs: they are compiled once.
        def scored(number: Int[Array, ""], scores: Scored) -> Scored:
            limb = jax.tree.map(lambda a: a[number], limbs)
            score = score_limb(model.body, pose, objective, some, limb, points, costs)
            return jax.tree.map(lambda all_scores, own: all_scores.at[number].set(own), scores, score)

        none = jax.tree.map(lambda a: jnp.stack([a, a]), none_scored(costs))
        scores = jax.lax.fori_loop(0, jnp.where(alone, 1, 2), scored, none)
        left, right = (jax.tree.map(lambda a, i=i: a[i], scores) for i in (0, 1))
        rows, other_rows = best_pairs(left, right, count)
        other_rows = jnp.where(alone, rows, other_rows)
        return jax.vmap(lambda i, j: with_limb(with_limb(pose, first, i), second, j))(rows, other_rows)

    return jax.vmap(one)(poses, jnp.asarray(frames))
