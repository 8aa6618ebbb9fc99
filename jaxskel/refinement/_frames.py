"""Refinement of single frames (Sect. 3.3): a constrained least squares solved by Optimistix, vmapped over frames."""

from concurrent.futures import Executor
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax.core import Tracer
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int

from .._runtime.batching import STACK
from .._runtime.compile_cache import cached_jit
from ..body import Pose, Skeleton
from ._arguments import check_frames
from ._covariance import equations_at, spread
from ._trusted_gradient import trusted_gradient
from .parametrisations import Parametrisation
from .solvers import NormalEquations, NormalEquationsLM
from .terms import Objective, Observed

Solver = optx.AbstractLeastSquaresSolver | optx.AbstractMinimiser

# Frames per batch: larger batches wait longer for their slowest frame, and exceed the processor's cache.
_AT_ONCE = 8
# Numbers of frames that programs are compiled for; the larger one is also that of a recording's batches.
_STACKS = _AT_ONCE, STACK


class Refined(eqx.Module):
    """Refined poses of some frames, the final cost of each term, and the solver's outcome.

    Attributes:
        joints: (m, in the world)
        tips: (m, in the world)
        covariance: Of each joint, see `joint_covariance`: in m^2 if a residual of one is one standard deviation.
        costs: Weighted cost of each term, by its name.
        converged: Whether the last solve met the solver's tolerances within its steps.
        finite: Whether the pose and its costs are finite; if not, the initial pose is returned.
        steps: Number of solver steps of the last solve.
    """

    pose: Pose
    joints: Float[Array, "*frames joints 3"]
    tips: Float[Array, "*frames tips 3"]
    covariance: Float[Array, "*frames joints 3 3"]
    costs: dict[str, Float[Array, "*frames"]]
    converged: Bool[Array, "*frames"]
    finite: Bool[Array, "*frames"]
    steps: Int[Array, "*frames"]


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
    """Refine the pose of one frame. Arguments as for [`refine_frames`][], but without the frames axis.

    Raises:
        ValueError: The objective couples frames.
    """
    if objective.couplings:
        raise ValueError(f"{', '.join(objective.couplings)}: couples frames; use refine_sequence, or leave it out")

    def residuals(unknowns: Float[Array, " unknowns"], args: Any) -> Float[Array, " rows"]:
        base, fixed = args
        found = objective.residuals(parametrisation.reached(unknowns, base, skeleton), observed, fixed)
        kept = parametrisation.constraint_residuals(parametrisation.retract(unknowns, base, skeleton), skeleton)
        # One vector: of a tree, all that a solver computes is compiled and started once for each term.
        return ravel_pytree(found | kept)[0]

    # Correspondences change between solves only: an argmin inside the residual keeps the solver from converging.
    def one_round(base: Any, _: None) -> tuple[Any, tuple[Array, Array, Any]]:
        fixed = objective.correspond(parametrisation.placed(base, skeleton), observed)
        solution = optx.least_squares(
            residuals,
            solver,
            parametrisation.unknowns(skeleton),
            args=(base, fixed),
            max_steps=max_steps,
            throw=False,
        )
        # This package's solver has the equations at its solution: to form them again would be compiled once more.
        equations = (
            solution.state.equations
            if isinstance(solver, NormalEquationsLM) and solver.equations is NormalEquations
            else equations_at(lambda unknowns: residuals(unknowns, (base, fixed)), solution.value)
        )
        after = parametrisation.settled(parametrisation.retract(solution.value, base, skeleton), skeleton)
        ended = solution.result == optx.RESULTS.successful, solution.stats["num_steps"]
        return after, (*ended, (equations, solution.value, base))

    start = parametrisation.begin(in_precision_of(parametrisation.unknowns(skeleton), initial), skeleton)
    base, (converged, steps, solved) = jax.lax.scan(one_round, start, None, length=rounds)
    equations, moved, before = jax.tree.map(lambda each: each[-1], solved)
    covariance = spread(equations, parametrisation, moved, before, skeleton)
    inputs = objective, parametrisation, skeleton, observed
    base, spreads = trusted_gradient((base, covariance), converged[-1], inputs)
    costs = objective.costs(parametrisation.placed(base, skeleton), observed)
    costs |= {name: (rows**2).sum() for name, rows in parametrisation.constraint_residuals(base, skeleton).items()}
    # With NaN data the solver stays at its start: the pose is finite then, but its costs are not.
    finite = jnp.isfinite(ravel_pytree((base, list(costs.values())))[0]).all()
    base = jax.tree.map(lambda new, old: jnp.where(finite, new, old), base, start)
    body, pose = parametrisation.placed(base, skeleton), parametrisation.pose(base, skeleton)
    return Refined(pose, body.joints, body.tips, spreads, costs, converged[-1] & finite, finite, steps[-1])


def in_precision_of(unknowns: Float[Array, " unknowns"], initial: Pose) -> Pose:
    """Start poses in the precision of the unknowns: with ``JAX_ENABLE_X64`` these are doubles."""
    return jax.tree.map(lambda a: jnp.asarray(a, jnp.promote_types(a.dtype, unknowns.dtype)), initial)


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
    """Refine the poses of a batch of frames, each by itself (Sect. 3.3).

    Another number of frames compiles nothing: frames are refined in stacks of fixed sizes. It is compiled for each
    number of frames only within a function that is itself compiled or differentiated.

    Args:
        objective: Weighted terms; any Module with the same methods will do.
        parametrisation: How a pose is written as unknowns.
        solver: Any least squares solver or minimiser of Optimistix.
        skeleton: Template (m).
        initial: Start poses (m, in the world), with a leading frames axis.
        observed: Graph and outlines (m, in the world), with a leading frames axis.
        rounds: How often correspondences are looked up and the problem is solved.
        max_steps: Largest number of solver steps in each round.

    Returns:
        Poses, cost of each term and the solver's outcome for every frame. A frame that fails does not affect others.
        Derivatives of a frame that has not converged are NaN, see `trusted_gradient`.

    Raises:
        ValueError: A term couples frames: use `refine_sequence`. Or an argument makes no sense.
    """
    check_frames(objective, parametrisation, solver, skeleton, initial, observed, rounds, max_steps)
    count = len(initial.root)

    def solved(initial: Pose, observed: Observed) -> Refined:
        return _refined(objective, parametrisation, solver, skeleton, initial, observed, rounds, max_steps)

    # A frame by itself has a program of its own, see `_refined`.
    size = 1 if count == 1 else next((size for size in _STACKS if count <= size), _STACKS[-1])
    given = jax.tree.leaves((objective, skeleton, initial, observed))
    if count in (0, size) or any(isinstance(leaf, Tracer) for leaf in given):
        return solved(initial, observed)
    whole = jax.tree.map(np.asarray, (initial, observed))
    parts = []
    for first in range(0, count, size):
        left = min(size, count - first)
        # The last stack is filled up with its first frame.
        rows = _rows(first, left, size)
        part = jax.tree.map(lambda a, rows=rows: a[rows], whole)
        parts.append(jax.tree.map(lambda a, left=left: np.asarray(a)[:left], solved(*part)))
    return jax.tree.map(lambda *some: jnp.asarray(np.concatenate(some)), *parts)


def _rows(first: int, count: int, size: int) -> slice | Int[np.ndarray, " size"]:
    if count == size:
        return slice(first, first + size)
    return first + np.where(np.arange(size) < count, np.arange(size), 0)


def refine_frames_ahead(threads: Executor, *arguments: Any) -> None:
    """Begin to compile `refine_frames` for a stack of frames, given its arguments in their order."""
    _refined.ahead(threads, *arguments)


@cached_jit
def _refined(
    objective: Objective,
    parametrisation: Parametrisation,
    solver: Solver,
    skeleton: Skeleton,
    initial: Pose,
    observed: Observed,
    rounds: int,
    max_steps: int,
) -> Refined:
    def one(each: tuple[Int[Array, ""], Pose]) -> Refined:
        # Indexed in the stack: slicing would copy the silhouettes.
        frame = observed.of(each[0])
        return refine_frame(objective, parametrisation, solver, skeleton, each[1], frame, rounds, max_steps)

    count = len(initial.root)
    # A frame by itself need not take the steps of both branches, as frames of a batch do.
    return jax.lax.map(one, (jnp.arange(count, dtype=jnp.int32), initial), batch_size=None if count == 1 else _AT_ONCE)
