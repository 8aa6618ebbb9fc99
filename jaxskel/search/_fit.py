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
# Steps from each of some poses, after which only the cheapest is fitted further.
_TRIED = 2

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
    objective = objective.of_body(body)
    pose = _stepped(objective, body, pose, observed.thinned(_FEW), scales[0], 0, scales[1])
    return pose, _cost(objective, body, pose, observed)


def fit_one_of(
    body: Body, objective: Objective, poses: Pose, observed: Observed, scales: Scales
) -> tuple[Pose, Float[Array, ""]]:
    """As `fit_hypothesis` from the better of some poses: the one that is cheapest after the first steps."""
    objective, few = objective.of_body(body), observed.thinned(_FEW)
    poses = jax.vmap(lambda pose: _stepped(objective, body, pose, few, scales[0], 0, _TRIED))(poses)
    best = jnp.argmin(jax.vmap(lambda pose: _cost(objective, body, pose, few))(poses))
    pose = jax.tree.map(lambda a: a[best], poses)
    pose = _stepped(objective, body, pose, few, scales[0], _TRIED, scales[1])
    return pose, _cost(objective, body, pose, observed)


def _stepped(
    objective: Objective, body: Body, pose: Pose, few: Observed, scales: Float[Array | np.ndarray, " steps"],
    first: int, end: Int[Array | np.ndarray, ""] | int,
) -> Pose:  # fmt: skip
    """Take some steps from a pose."""

    def step(number: Array, pose: Pose) -> Pose:
        return descend(objective.at_scale(scales[number]), _HINGED, body.skeleton, pose, few)

    return jax.lax.fori_loop(first, end, step, pose)


def _cost(objective: Objective, body: Body, pose: Pose, observed: Observed) -> Float[Array, ""]:
    cost = sum(objective.costs(place(body.skeleton, pose), observed).values(), jnp.zeros(()))
    return jnp.where(jnp.isfinite(cost), cost, jnp.inf)


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
