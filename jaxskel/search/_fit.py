"""Fit batches of hypotheses: all take the same number of steps, in chunks of a fixed size.

What takes long pauses after each chunk, see `Steps`: a search may last over several frames of a stream.
"""

from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._runtime.batching import length_of, take
from .._runtime.compile_cache import cached_jit
from .._runtime.steps import Steps, finished
from ..body import Body, Pose
from ..refinement.parametrisations import HingedLimbs
from ..refinement.terms import Objective, Observed, place
from ._gauss_newton import descend
from ._hypotheses import Pool

_HINGED = HingedLimbs()
_MOST_STEPS = 16  # length of the array of scales, fixed so that other step counts do not compile again
# Hypotheses per chunk: enough to hide the overhead of XLA's many small steps.
_AT_ONCE = 8
# The same for a frame by itself, which has few of them and should not wait long for a chunk.
_ALONE = (2, 4)
# A step uses one in this many rays; the final cost uses all.
_FEW = 6

# NumPy arrays: a module constant must not start JAX, which would take all cores before a process is assigned one.
Scales = tuple[Float[Array | np.ndarray, " steps"], Int[Array | np.ndarray, ""]]


def fit_scales(*rounds: tuple[float, int]) -> Scales:
    """Robust scales (m) and the number of steps with each, as `fit_pool` takes them; other values do not recompile."""
    values = np.concatenate([np.full(steps, scale, np.float32) for scale, steps in rounds])
    return np.resize(values, _MOST_STEPS), np.array(len(values), np.int32)


def fit_pool(body: Body, objective: Objective, pool: Pool, stack: Observed, scales: Scales) -> Pool:
    """Minimise an objective of this body from each hypothesis of a pool; return the poses and their costs."""
    return finished(fitting(body, objective, pool, stack, scales))


def fitting(body: Body, objective: Objective, pool: Pool, stack: Observed, scales: Scales) -> Steps[Pool]:
    """As `fit_pool`, in steps."""
    if len(pool) == 0:
        return pool

    def fitted(poses: Pose, frames: Int[np.ndarray, " chunk"]) -> tuple[Pose, Float[Array, " chunk"]]:
        return _fitted(body, objective, poses, frames, stack, scales)

    poses, cost = yield from in_chunks(fitted, pool, _sizes(stack))
    return Pool(pool.frame, poses, cost)


def fit_ahead(
    threads: Executor, body: Body, objective: Objective, poses: Callable[[int], Pose], stack: Observed
) -> None:
    """Begin to compile the fits of a body to a stack of observations; `poses` makes any number of poses."""
    for size in _sizes(stack):
        _fitted.ahead(threads, body, objective, poses(size), np.zeros(size, np.int32), stack, fit_scales((0.04, 1)))


def _sizes(stack: Observed) -> tuple[int, ...]:
    return _ALONE if length_of(stack) == 1 else (_AT_ONCE,)


def in_chunks(work: Callable[[Pose, Int[np.ndarray, " chunk"]], Any], pool: Pool, sizes: tuple[int, ...]) -> Steps[Any]:
    """Apply `work` to the poses of a pool and their frames in chunks of the given sizes; the last one is padded."""
    done, start = [], 0
    while start < len(pool):
        size = next((size for size in sizes if size >= len(pool) - start), sizes[-1])
        chosen = np.minimum(np.arange(start, start + size), len(pool) - 1)
        given = take(pool.poses, chosen), pool.frame[chosen].astype(np.int32)
        done.append(jax.tree.map(np.asarray, work(*given)))
        start += size
        yield
    return jax.tree.map(lambda *parts: np.concatenate(parts)[: len(pool)], *done)


def fit_hypothesis(
    body: Body, objective: Objective, pose: Pose, observed: Observed, scales: Scales
) -> tuple[Pose, Float[Array, ""]]:
    """Minimise from one hypothesis of one frame; return the pose and its cost, infinite where that is not finite."""
    # The body is put in here, so that the compiler sees that all terms share one, and places it once.
    objective, few = objective.of_body(body), observed.thinned(_FEW)

    def step(number: Array, pose: Pose) -> Pose:
        scaled = objective.at_scale(scales[0][number])
        return descend(scaled, _HINGED, body.skeleton, pose, few)

    pose = jax.lax.fori_loop(0, scales[1], step, pose)
    cost = sum(objective.costs(place(body.skeleton, pose), observed).values(), jnp.zeros(()))
    return pose, jnp.where(jnp.isfinite(cost), cost, jnp.inf)


@cached_jit
def _fitted(
    body: Body,
    objective: Objective,
    poses: Pose,
    frames: Int[Array | np.ndarray, " n"],
    stack: Observed,
    scales: Scales,
) -> tuple[Pose, Float[Array, " n"]]:
    def one(pose: Pose, frame: Int[Array, ""]) -> tuple[Pose, Float[Array, ""]]:
        return fit_hypothesis(body, objective, pose, stack.of(frame), scales)

    return jax.vmap(one)(poses, jnp.asarray(frames))
