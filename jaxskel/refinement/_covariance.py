"""How well the residuals determine the joints: covariances from the normal equations at a solution."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from ..body import Skeleton
from .parametrisations import Parametrisation
from .solvers import NormalEquations
from .terms import Objective, Observed

# Added to the normal matrix: absolute, for unknowns that nothing observes, and a share of its diagonal, against
# rounding errors.
_UNSEEN, _RELATIVE = 1e-2, 1e-5


def joint_covariance(
    objective: Objective, parametrisation: Parametrisation, base: Any, skeleton: Skeleton, observed: Observed
) -> Float[Array, "joints 3 3"]:
    """Covariance of the joints of one frame, G (J^T J)^-1 G^T, where J and G are derivatives by the unknowns.

    J is that of the residuals, with correspondences fixed, and G that of the joints.

    Args:
        objective: Weighted terms of single frames.
        parametrisation: How a pose is expressed by unknowns.
        base: The solution, as the parametrisation expresses it.
        skeleton: Template (m).
        observed: What the frame shows.

    Returns:
        Covariances in m^2, if a residual of one is one standard deviation.
    """
    fixed, start = (
        objective.correspond(parametrisation.placed(base, skeleton), observed),
        parametrisation.unknowns(skeleton),
    )

    def residuals(unknowns: Float[Array, " unknowns"]) -> dict[str, Array]:
        kept = parametrisation.constraint_residuals(parametrisation.retract(unknowns, base, skeleton), skeleton)
        return objective.residuals(parametrisation.reached(unknowns, base, skeleton), observed, fixed) | kept

    return spread(equations_at(residuals, start), parametrisation, start, base, skeleton)


def equations_at(
    residuals: Callable[[Float[Array, " unknowns"]], PyTree[Array]], unknowns: Float[Array, " unknowns"]
) -> NormalEquations:
    """Normal equations of residuals, linearised at some unknowns."""
    found, slope = jax.linearize(residuals, unknowns)
    return NormalEquations.of(unknowns, found, slope)


def spread(
    equations: NormalEquations,
    parametrisation: Parametrisation,
    unknowns: Float[Array, " unknowns"],
    base: Any,
    skeleton: Skeleton,
) -> Float[Array, "joints 3 3"]:
    """Covariance of the joints where normal equations have been formed: at some unknowns, relative to a base."""
    _, slope = jax.linearize(lambda some: parametrisation.reached(some, base, skeleton).joints, unknowns)
    moved = jax.vmap(slope, out_axes=-1)(jnp.eye(len(unknowns), dtype=unknowns.dtype))
    damped = equations.matrix + jnp.diag(_UNSEEN + _RELATIVE * jnp.diagonal(equations.matrix))
    factor = jax.scipy.linalg.cho_factor(damped, lower=True)
    solved = jax.scipy.linalg.cho_solve(factor, moved.reshape(-1, len(unknowns)).T)
    return jnp.einsum("jau,ujb->jab", moved, solved.reshape(len(unknowns), *moved.shape[:2]))
