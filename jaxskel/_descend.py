"""Damped Gauss-Newton with a fixed number of steps: what the search spends on each of its many hypotheses.

One step for each look-up of correspondences, no line search and no test of convergence: a batch of hypotheses takes
the same steps whatever its members do. The pose that wins is handed to the solver of `refine_frames`.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._skeleton import Pose, Skeleton
from .parametrisations import HingedLimbs
from .terms import Objective, Observed, place

# Of the normal matrix: absolute, for unknowns that nothing holds, and as a share of its diagonal.
_DAMPING, _RELATIVE_DAMPING = 0.1, 1e-3
# A step is not trusted farther than this (m, rad).
_REACH = 0.4


def descend(
    objective: Objective, parametrisation: HingedLimbs, skeleton: Skeleton, pose: Pose, observed: Observed
) -> Pose:
    """Let the pose of one frame descend by one damped Gauss-Newton step."""
    fixed = objective.correspond(place(skeleton, pose), observed)

    def residuals(unknowns: Float[Array, " unknowns"]) -> Float[Array, " rows"]:
        body = place(skeleton, parametrisation.nearby(unknowns, pose, skeleton))
        return jnp.concatenate([r.ravel() for r in objective.residuals(body, observed, fixed).values()])

    zeros = parametrisation.unknowns()
    value, tangent = jax.linearize(residuals, zeros)
    jacobian = jax.vmap(tangent)(jnp.eye(len(zeros)))  # unknowns x rows
    matrix = jacobian @ jacobian.T
    damped = matrix + jnp.diag(_DAMPING + _RELATIVE_DAMPING * jnp.diagonal(matrix))
    unknowns = -jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(damped, lower=True), jacobian @ value)
    return parametrisation.pose(jnp.clip(unknowns, -_REACH, _REACH), pose, skeleton)
