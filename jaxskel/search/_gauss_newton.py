"""Damped Gauss-Newton with a fixed number of steps: what the search spends on each of its many hypotheses.

One step for each look-up of correspondences, no line search and no test of convergence: a batch of hypotheses takes
the same steps whatever its members do. The pose that wins is handed to the solver of `refine_frames`.
"""

import jax
import jax.numpy as jnp

from ..body import Pose, Skeleton
from ..refinement.parametrisations import HingedLimbs
from ..refinement.terms import CapsuleTerm, Objective, Observed, place
from ._block_normal_equations import normal_equations

# Of the normal matrix: absolute, for unknowns that nothing holds, and as a share of its diagonal.
_DAMPING, _RELATIVE_DAMPING = 0.1, 1e-3
# A step is not trusted farther than this (m, rad).
_REACH = 0.4


def descend(
    objective: Objective, parametrisation: HingedLimbs, skeleton: Skeleton, pose: Pose, observed: Observed
) -> Pose:
    """Let the pose of one frame descend by one damped Gauss-Newton step."""
    placed = place(skeleton, pose)
    motion = parametrisation.motion(pose, placed, skeleton)
    others = Objective({name: term for name, term in objective.terms.items() if not isinstance(term, CapsuleTerm)})
    fixed = others.correspond(placed, observed)
    value, tangent = jax.linearize(lambda body: others.residuals(body, observed, fixed), placed)
    changes = jax.vmap(tangent, -1, -1)(motion.of_body(placed))

    count = len(motion.turns)
    # One product of long rows instead of one for each term.
    rows = jnp.concatenate([jnp.zeros((0, count)), *(change.reshape(-1, count) for change in changes.values())])
    residuals = jnp.concatenate([jnp.zeros(0), *(value[name].ravel() for name in changes)])
    matrix, gradient = rows.T @ rows, rows.T @ residuals
    for terms in _by_body([term for term in objective.terms.values() if isinstance(term, CapsuleTerm)]):
        ends, body = terms[0].ends(placed), terms[0].body
        quadrics = [(term.weight, term.quadrics(placed, observed)) for term in terms]
        inner = sum((weight * each.matrix for weight, each in quadrics), jnp.zeros(()))
        pull = sum((weight * each.vector for weight, each in quadrics), jnp.zeros(()))
        more, slope = normal_equations(motion, ends, body.segments[body.links], inner, pull)
        matrix, gradient = matrix + more, gradient + slope
    damped = matrix + jnp.diag(_DAMPING + _RELATIVE_DAMPING * jnp.diagonal(matrix))
    unknowns = -jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(damped, lower=True), gradient)
    return parametrisation.retract(jnp.clip(unknowns, -_REACH, _REACH), pose, skeleton)


def _by_body(terms: list[CapsuleTerm]) -> list[list[CapsuleTerm]]:
    """Terms of the same body together: what their capsules cost adds up before the unknowns come in."""
    groups: dict[int, list[CapsuleTerm]] = {}
    for term in terms:
        groups.setdefault(id(term.body), []).append(term)
    return list(groups.values())
