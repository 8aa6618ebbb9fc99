"""Refinement (Sect. 3.3): a constrained least squares for each frame, solved by Optimistix, vmapped over frames."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int

from .._runtime.compile_cache import cached_jit
from ..body import Pose, Skeleton
from .parametrisations import Parametrisation
from .terms import Objective, Observed

Solver = optx.AbstractLeastSquaresSolver | optx.AbstractMinimiser

# Frames that are solved at once. More of them wait longer for the slowest, and leave the processor's cache.
_AT_ONCE = 8


class Refined(eqx.Module):
    """Refined poses of some frames, with what each term still costs and how the solver ended."""

    pose: Pose
    joints: Float[Array, "*frames joints=15 3"]
    """(m)"""
    tips: Float[Array, "*frames tips=5 3"]
    """(m)"""
    costs: dict[str, Float[Array, "*frames"]]
    """Weighted cost by each term, by name."""
    converged: Bool[Array, "*frames"]
    """The last solve met the solver's tolerances within its steps."""
    finite: Bool[Array, "*frames"]
    """The pose and its costs are numbers; where they are not, the initial pose is given back."""
    steps: Int[Array, "*frames"]
    """Solver steps of the last solve."""


def refine_frame(
    objective: Objective,
    parametrisation: Parametrisation,
    solver: Solver,
    skeleton: Skeleton,
    initial: Pose,
    observed: Observed,
    rounds: int = 3,
    max_steps: int = 16,
) -> Refined:
    """Refine the pose of one frame. See [`refine_frames`][]; the arrays have no frames axis here."""
    if objective.couplings:
        raise ValueError(f"{', '.join(objective.couplings)}: couples frames; use refine_sequence, or leave it out")

    def residuals(unknowns: Float[Array, " unknowns"], args: Any) -> dict[str, Array]:
        base, fixed = args
        found = objective.residuals(parametrisation.reached(unknowns, base, skeleton), observed, fixed)
        return found | parametrisation.constraint_residuals(parametrisation.retract(unknowns, base, skeleton), skeleton)

    # Correspondences are looked up between solves: an argmin inside the residual keeps the solver from converging.
    def one_round(base: Any, _: None) -> tuple[Any, tuple[Array, Array]]:
        fixed = objective.correspond(parametrisation.placed(base, skeleton), observed)
        solution = optx.least_squares(
            residuals,
            solver,
            parametrisation.unknowns(),
            args=(base, fixed),
            max_steps=max_steps,
            throw=False,
        )
        base = parametrisation.settled(parametrisation.retract(solution.value, base, skeleton), skeleton)
        return base, (solution.result == optx.RESULTS.successful, solution.stats["num_steps"])

    start = parametrisation.begin(jax.tree.map(jnp.asarray, initial), skeleton)
    base, (converged, steps) = jax.lax.scan(one_round, start, None, length=rounds)
    costs = objective.costs(parametrisation.placed(base, skeleton), observed)
    costs |= {name: (rows**2).sum() for name, rows in parametrisation.constraint_residuals(base, skeleton).items()}
    # A solver that meets NaN data stays at its start: the pose is a number then, its costs are not.
    finite = jnp.isfinite(ravel_pytree((base, list(costs.values())))[0]).all()
    base = jax.tree.map(lambda new, old: jnp.where(finite, new, old), base, start)
    body, pose = parametrisation.placed(base, skeleton), parametrisation.pose(base, skeleton)
    return Refined(pose, body.joints, body.tips, costs, converged[-1] & finite, finite, steps[-1])


@cached_jit
def refine_frames(
    objective: Objective,
    parametrisation: Parametrisation,
    solver: Solver,
    skeleton: Skeleton,
    initial: Pose,
    observed: Observed,
    rounds: int = 3,
    max_steps: int = 16,
) -> Refined:
    """Refine the poses of a batch of frames, each by itself.

    Args:
        objective: Weighted terms; any Module with the same methods will do.
        parametrisation: How a pose is written as unknowns.
        solver: Any solver of Optimistix for least squares, or any of its minimisers.
        skeleton: Template.
        initial: Poses to start from, with a leading frames axis.
        observed: What was measured, with a leading frames axis.
        rounds: How often correspondences are looked up again.
        max_steps: Steps of the solver in each round.

    Returns:
        Poses, costs by term and the solver's outcome for every frame. A frame that fails does not harm the others.

    Raises:
        ValueError: A term couples frames: that is for `refine_sequence`.
    """

    def one(each: tuple[Int[Array, ""], Pose]) -> Refined:
        # Looked up in the stack: cut out of it, silhouettes would be copied.
        frame = observed.of(each[0])
        return refine_frame(objective, parametrisation, solver, skeleton, each[1], frame, rounds, max_steps)

    return jax.lax.map(one, (jnp.arange(len(initial.root), dtype=jnp.int32), initial), batch_size=_AT_ONCE)
