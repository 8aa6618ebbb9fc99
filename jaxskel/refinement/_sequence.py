"""Refinement of a sequence: all frames are solved together, coupled in time. Not in the paper."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax.core import Tracer
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int

from .._runtime.batching import step_above
from .._runtime.compile_cache import cached_jit
from ..body import Pose, Skeleton
from ._arguments import check_follows, check_sequence
from ._covariance import joint_covariance
from ._frames import Refined, Solver, in_precision_of
from .parametrisations import Parametrisation
from .solvers import Coupled
from .terms import Objective, Observed, PlacedBody

# Frames whose correspondences are looked up at once: larger batches exceed the processor's cache.
_AT_ONCE = 8
# Sequences are padded to powers of two up to this number of frames, and by at most a quarter beyond it.
_POWERS = 128


def refine_sequence(
    objective: Objective,
    parametrisation: Parametrisation,
    solver: Solver,
    skeleton: Skeleton,
    initial: Pose,
    observed: Observed,
    rounds: int = 3,
    max_steps: int = 2,
    follows: Bool[np.ndarray, " frames"] | None = None,
) -> Refined:
    """Refine the poses of consecutive frames together, with time and memory that grow linearly with their number.

    A frame whose pose or data are not finite is bridged: its own terms are left out, and its pose follows from the
    couplings to its neighbours alone.

    Another number of frames compiles nothing, if it is padded to the same length: to a power of two, and beyond 128
    frames by at most a quarter. Within a function that is itself compiled or differentiated, nothing is padded.

    Args:
        objective: Weighted terms, some of which are couplings such as `Smoothness`.
        parametrisation: How a pose is written as unknowns.
        solver: `sequence_solver()`, or any matrix-free solver of Optimistix, such as
            ``optimistix.LevenbergMarquardt(rtol, atol, linear_solver=lineax.Normal(lineax.CG(...)))``.
        skeleton: Template (m).
        initial: Start poses (m, in the world), with a leading frames axis.
        observed: Graph and outlines (m, in the world), with a leading frames axis.
        rounds: How often correspondences are looked up and the problem is solved.
        max_steps: Largest number of solver steps in each round.
        follows: Whether each frame comes directly after the one before it, if frames are missing between some. A
            coupling holds only for three frames that follow one another.

    Returns:
        As for `refine_frames`. `finite` is false for bridged frames; the cost of a coupling is listed at its middle
        frame. `converged` and `steps` are those of the joint solve.

    Raises:
        ValueError: An argument makes no sense.
    """
    check_sequence(objective, parametrisation, solver, skeleton, initial, observed, rounds, max_steps)
    count = len(initial.root)
    follows = np.ones(count, bool) if follows is None else check_follows(follows, count)
    size = count
    if not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((objective, skeleton, initial, observed))):
        size = _length(count)
    if size != count:
        # Padded by the last frame.
        rows = np.minimum(np.arange(size), max(count - 1, 0))
        initial, observed = jax.tree.map(lambda a: _rows(a, rows), (initial, observed))
    given, joined = np.arange(size) < count, np.zeros(size, bool)
    joined[:count] = follows
    found = _refined(
        objective, parametrisation, solver, skeleton, initial, observed, given, joined, rounds, max_steps
    )  # fmt: skip
    return found if size == count else jax.tree.map(lambda a: jnp.asarray(np.asarray(a)[:count]), found)


def _length(count: int) -> int:
    """Number of frames that a program is compiled for."""
    power = 1 << (count - 1).bit_length()
    return max(_AT_ONCE, power if power <= _POWERS else step_above(count))


def _rows(a: Any, rows: Int[np.ndarray, " size"]) -> np.ndarray:
    return np.asarray(a)[rows] if len(a) else np.zeros((len(rows), *a.shape[1:]), a.dtype)


@cached_jit
def _refined(
    objective: Objective,
    parametrisation: Parametrisation,
    solver: Solver,
    skeleton: Skeleton,
    initial: Pose,
    observed: Observed,
    given: Bool[Array | np.ndarray, " frames"],
    joined: Bool[Array | np.ndarray, " frames"],
    rounds: int,
    max_steps: int,
) -> Refined:
    """Refine a padded sequence.

    Frames that are not given, which are the last ones, have no residuals; `joined` says which frames follow the one
    before them.
    """
    count = len(initial.root)
    frames = jnp.arange(count, dtype=jnp.int32)

    def one_by_one(function: Any, *stacks: Any) -> Any:
        return jax.lax.map(lambda each: function(*each[1:], observed.of(each[0])), (frames, *stacks),
                           batch_size=_AT_ONCE)  # fmt: skip

    def costs_of(base: Any, frame: Observed) -> dict[str, Array]:
        held = {name: (rows**2).sum() for name, rows in parametrisation.constraint_residuals(base, skeleton).items()}
        return objective.costs(parametrisation.placed(base, skeleton), frame) | held

    given, joined = jnp.asarray(given), jnp.asarray(joined)
    poses = in_precision_of(parametrisation.unknowns(skeleton), initial)
    first = jax.vmap(lambda pose: parametrisation.begin(pose, skeleton))(poses)
    before = one_by_one(costs_of, first)
    seen = given & jax.vmap(lambda each: jnp.isfinite(ravel_pytree(each)[0]).all())((first, before))
    source = _nearest_of(seen)
    start = jax.tree.map(lambda a: a[source], first)

    def bodies(base: Any) -> PlacedBody:
        return jax.vmap(lambda one: parametrisation.placed(one, skeleton))(base)

    def retract(unknowns: Float[Array, "frames unknowns"], base: Any) -> Any:
        return jax.vmap(lambda u, one: parametrisation.retract(u, one, skeleton))(unknowns, base)

    def residuals(unknowns: Float[Array, "frames unknowns"], args: Any) -> Coupled:
        def one(each: Any) -> tuple[dict[str, Array], Array]:
            unknowns, (base, fixed), frame, used, kept = each
            own = objective.residuals(parametrisation.reached(unknowns, base, skeleton), frame, fixed)
            own = {name: jnp.where(used, rows, 0.0) for name, rows in own.items()}
            held = parametrisation.constraint_residuals(parametrisation.retract(unknowns, base, skeleton), skeleton)
            held = {name: jnp.where(kept, rows, 0.0) for name, rows in held.items()}
            # A frame that is not given stays where it is, whatever solver divides by its part of the matrix.
            return own | held, jnp.where(kept, 0.0, unknowns)

        own = jax.lax.map(one, (unknowns, args, observed, seen, given), batch_size=_AT_ONCE)
        reached = jax.vmap(lambda u, one: parametrisation.reached(u, one, skeleton))(unknowns, args[0])
        return Coupled(own, _couplings(objective, reached, joined))

    def one_round(base: Any, _: None) -> tuple[Any, tuple[Array, Array]]:
        fixed = one_by_one(lambda one, frame: objective.correspond(parametrisation.placed(one, skeleton), frame), base)
        zeros = jnp.zeros((count, parametrisation.unknowns(skeleton).size))
        solution = optx.least_squares(
            residuals, solver, zeros, args=(base, fixed), max_steps=max_steps, throw=False
        )  # fmt: skip
        base = jax.vmap(lambda one: parametrisation.settled(one, skeleton))(retract(solution.value, base))
        return base, (solution.result == optx.RESULTS.successful, solution.stats["num_steps"])

    base, (converged, steps) = jax.lax.scan(one_round, start, None, length=rounds)
    whole = jnp.isfinite(ravel_pytree(base)[0]).all() & seen.any()
    base = jax.tree.map(lambda new, old: jnp.where(whole, new, old), base, first)
    placed, pose = bodies(base), jax.vmap(lambda one: parametrisation.pose(one, skeleton))(base)
    costs = one_by_one(costs_of, base)
    for name, rows in _couplings(objective, placed, joined).items():
        between = (rows.reshape(len(rows), -1) ** 2).sum(1)
        costs[name] = jnp.zeros(count, between.dtype).at[1:-1].set(between)
    ended, taken = jnp.broadcast_to(converged[-1] & whole, count), jnp.broadcast_to(steps[-1], count)
    alone = Objective({**objective.of_frames})  # without the couplings, which would only lower it
    covariance = one_by_one(lambda one, frame: joint_covariance(alone, parametrisation, one, skeleton, frame), base)
    return Refined(pose, placed.joints, placed.tips, covariance, costs, ended, seen & whole, taken)


def _couplings(
    objective: Objective, placed: PlacedBody, joined: Bool[Array, " frames"]
) -> dict[str, Float[Array, "couplings ..."]]:
    """Weighted residuals of all triples of frames; zero where they do not follow one another."""
    if len(placed.joints) < 3:
        return {}
    holds = joined[1:-1] & joined[2:]
    some = jnp.argmax(holds)

    def only_where_it_holds(rows: Array, otherwise: Any) -> Array:
        return jnp.where(holds.reshape(len(holds), *(1 for _ in rows.shape[1:])), rows, otherwise)

    # Elsewhere stand the bodies of a triple that holds: where bodies are equal, a distance has no derivative.
    three = (
        jax.tree.map(lambda a, i=i: only_where_it_holds(a[i : len(a) - 2 + i], a[some + i]), placed) for i in range(3)
    )
    return {name: only_where_it_holds(rows, 0.0) for name, rows in objective.coupled(*three).items()}


def _nearest_of(seen: Bool[Array, " frames"]) -> Int[Array, " frames"]:
    """Index of the nearest frame that is seen, which may be the frame itself; its own index if none is seen."""
    count = len(seen)
    frames = jnp.arange(count, dtype=jnp.int32)
    before = jax.lax.cummax(jnp.where(seen, frames, -count))
    after = jax.lax.cummin(jnp.where(seen, frames, 2 * count), reverse=True)
    return jnp.where(seen.any(), jnp.where(frames - before <= after - frames, before, after), frames)
