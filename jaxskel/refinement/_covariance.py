"""How well the residuals determine the joints: covariances from the normal equations at a solution."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..body import Skeleton
from .parametrisations import Parametrisation
from .solvers import NormalEquations
from .terms import Objective, Observed

# Added to the normal matrix: absolute, for unknowns that nothing observes, and a share of its diagonal, against
# rounding errors.
_UNSEEN, _RELATIVE = 1e-2, 1e-5


def joint_covariance(
    objective: Objective, parametrisation: Parametrisation, base: Any, skeleton: Skeleton, observed: Observed
) -> Float[Array, "joints=15 3 3"]:
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
    fixed, start = objective.correspond(parametrisation.placed(base, skeleton), observed), parametrisation.unknowns()

    def varied(unknowns: Float[Array, " unknowns"]) -> tuple[dict[str, Array], Float[Array, "joints=15 3"]]:
        body = parametrisation.reached(unknowns, base, skeleton)
        kept = parametrisation.constraint_residuals(parametrisation.retract(unknowns, base, skeleton), skeleton)
        return objective.residuals(body, observed, fixed) | kept, body.joints

    (residuals, _), slope = jax.linearize(varied, start)
    equations = NormalEquations.of(start, residuals, lambda change: slope(change)[0])
    moved = jax.vmap(lambda change: slope(change)[1], out_axes=-1)(jnp.eye(len(start), dtype=start.dtype))
    damped = equations.matrix + jnp.diag(_UNSEEN + _RELATIVE * jnp.diagonal(equations.matrix))
    factor = jax.scipy.linalg.cho_factor(damped, lower=True)
    spread = jax.scipy.linalg.cho_solve(factor, moved.reshape(-1, len(start)).T)
    return jnp.einsum("jau,ujb->jab", moved, spread.reshape(len(start), *moved.shape[:2]))
