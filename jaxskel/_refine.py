"""Refinement (Sect. 3.3): a constrained least squares for each frame, solved by Optimistix, vmapped over frames."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

from ._kept import kept
from ._skeleton import Pose, Skeleton
from .parametrisations import Parametrisation
from .terms import Objective, Observed, place

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
    solver: optx.AbstractLeastSquaresSolver,
    skeleton: Skeleton,
    initial: Pose,
    observed: Observed,
    rounds: int = 3,
    max_steps: int = 16,
) -> Refined:
    """Refine the pose of one frame. See [`refine_frames`][]; the arrays have no frames axis here."""

    def residuals(unknowns: Float[Array, " unknowns"], args: Any) -> dict[str, Array]:
        base, fixed = args
        return objective.residuals(place(skeleton, parametrisation.pose(unknowns, base, skeleton)), observed, fixed)

    # Correspondences are looked up between solves: an argmin inside the residual keeps the solver from converging.
    def one_round(base: Pose, _: None) -> tuple[Pose, tuple[Array, Array]]:
        fixed = objective.correspond(place(skeleton, base), observed)
        solution = optx.least_squares(
            residuals,
            solver,
            parametrisation.unknowns(),
            args=(base, fixed),
            max_steps=max_steps,
            throw=False,
        )
        pose = parametrisation.pose(solution.value, base, skeleton)
        return pose, (solution.result == optx.RESULTS.successful, solution.stats["num_steps"])

    start = jax.tree.map(jnp.asarray, initial)
    pose, (converged, steps) = jax.lax.scan(one_round, start, None, length=rounds)
    body = place(skeleton, pose)
    costs = objective.costs(body, observed)
    # A solver that meets NaN data stays at its start: the pose is a number then, its costs are not.
    finite = jnp.isfinite(pose.root).all() & jnp.isfinite(pose.rotations).all() & jnp.isfinite(sum(costs.values()))
    pose = jax.tree.map(lambda new, old: jnp.where(finite, new, old), pose, start)
    body = place(skeleton, pose)
    return Refined(pose, body.joints, body.tips, costs, converged[-1] & finite, finite, steps[-1])


@kept
def refine_frames(
    objective: Objective,
    parametrisation: Parametrisation,
    solver: optx.AbstractLeastSquaresSolver,
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
        solver: Any Optimistix least squares solver.
        skeleton: Template.
        initial: Poses to start from, with a leading frames axis.
        observed: What was measured, with a leading frames axis.
        rounds: How often correspondences are looked up again.
        max_steps: Steps of the solver in each round.

    Returns:
        Poses, costs by term and the solver's outcome for every frame. A frame that fails does not harm the others.
    """
    return jax.lax.map(
        lambda each: refine_frame(objective, parametrisation, solver, skeleton, each[0], each[1], rounds, max_steps),
        (initial, observed),
        batch_size=_AT_ONCE,
    )
