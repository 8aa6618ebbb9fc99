"""Refinement of a sequence: all frames are solved together, coupled in time. Not in the paper."""

from typing import Any

import jax
import jax.numpy as jnp
import optimistix as optx
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int

from .._runtime.compile_cache import checked_jit
from ..body import Pose, Skeleton
from ._arguments import check_sequence
from ._covariance import joint_covariance
from ._frames import Refined, Solver, in_precision_of
from .parametrisations import Parametrisation
from .solvers import Coupled
from .terms import Objective, Observed, PlacedBody

# Frames whose correspondences are looked up at once: larger batches exceed the processor's cache.
_AT_ONCE = 8


@checked_jit(check_sequence)
def refine_sequence(
    objective: Objective,
    parametrisation: Parametrisation,
    solver: Solver,
    skeleton: Skeleton,
    initial: Pose,
    observed: Observed,
    rounds: int = 3,
    max_steps: int = 2,
) -> Refined:
    """Refine the poses of consecutive frames together, with time and memory that grow linearly with their number.

    A frame whose pose or data are not finite is bridged: its own terms are left out, and its pose follows from the
    couplings to its neighbours alone.

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

    Returns:
        As for `refine_frames`. `finite` is false for bridged frames; the cost of a coupling is listed at its middle
        frame. `converged` and `steps` are those of the joint solve.
    """
    count = len(initial.root)
    frames = jnp.arange(count, dtype=jnp.int32)

    def one_by_one(function: Any, *stacks: Any) -> Any:
        return jax.lax.map(lambda each: function(*each[1:], observed.of(each[0])), (frames, *stacks),
                           batch_size=_AT_ONCE)  # fmt: skip

    def costs_of(base: Any, frame: Observed) -> dict[str, Array]:
        held = {name: (rows**2).sum() for name, rows in parametrisation.constraint_residuals(base, skeleton).items()}
        return objective.costs(parametrisation.placed(base, skeleton), frame) | held

    poses = in_precision_of(parametrisation.unknowns(skeleton), initial)
    given = jax.vmap(lambda pose: parametrisation.begin(pose, skeleton))(poses)
    before = one_by_one(costs_of, given)
    seen = jax.vmap(lambda each: jnp.isfinite(ravel_pytree(each)[0]).all())((given, before))
    source = _nearest_of(seen)
    start = jax.tree.map(lambda a: a[source], given)

    def bodies(base: Any) -> PlacedBody:
        return jax.vmap(lambda one: parametrisation.placed(one, skeleton))(base)

    def retract(unknowns: Float[Array, "frames unknowns"], base: Any) -> Any:
        return jax.vmap(lambda u, one: parametrisation.retract(u, one, skeleton))(unknowns, base)

    def residuals(unknowns: Float[Array, "frames unknowns"], args: Any) -> Coupled:
        def one(each: Any) -> dict[str, Array]:
            unknowns, (base, fixed), frame, used = each
            own = objective.residuals(parametrisation.reached(unknowns, base, skeleton), frame, fixed)
            own = {name: jnp.where(used, rows, 0.0) for name, rows in own.items()}
            return own | parametrisation.constraint_residuals(
                parametrisation.retract(unknowns, base, skeleton), skeleton
            )

        own = jax.lax.map(one, (unknowns, args, observed, seen), batch_size=_AT_ONCE)
        reached = jax.vmap(lambda u, one: parametrisation.reached(u, one, skeleton))(unknowns, args[0])
        return Coupled(own, _couplings(objective, reached))

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
    base = jax.tree.map(lambda new, old: jnp.where(whole, new, old), base, given)
    placed, pose = bodies(base), jax.vmap(lambda one: parametrisation.pose(one, skeleton))(base)
    costs = one_by_one(costs_of, base)
    for name, rows in _couplings(objective, placed).items():
        between = (rows.reshape(len(rows), -1) ** 2).sum(1)
        costs[name] = jnp.zeros(count, between.dtype).at[1:-1].set(between)
    ended, taken = jnp.broadcast_to(converged[-1] & whole, count), jnp.broadcast_to(steps[-1], count)
    alone = Objective({**objective.of_frames})  # without the couplings, which would only lower it
    covariance = one_by_one(lambda one, frame: joint_covariance(alone, parametrisation, one, skeleton, frame), base)
    return Refined(pose, placed.joints, placed.tips, covariance, costs, ended, seen & whole, taken)


def _couplings(objective: Objective, placed: PlacedBody) -> dict[str, Float[Array, "couplings ..."]]:
    """Weighted residuals of all triples of consecutive frames."""
    if len(placed.joints) < 3:
        return {}
    three = (jax.tree.map(lambda a, i=i: a[i : len(a) - 2 + i], placed) for i in range(3))
    return objective.coupled(*three)


def _nearest_of(seen: Bool[Array, " frames"]) -> Int[Array, " frames"]:
    """Index of the nearest frame that is seen, which may be the frame itself; its own index if none is seen."""
    count = len(seen)
    frames = jnp.arange(count, dtype=jnp.int32)
    before = jax.lax.cummax(jnp.where(seen, frames, -count))
    after = jax.lax.cummin(jnp.where(seen, frames, 2 * count), reverse=True)
    return jnp.where(seen.any(), jnp.where(frames - before <= after - frames, before, after), frames)
