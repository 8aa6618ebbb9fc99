"""Damped Gauss-Newton with a fixed number of steps, for the many hypotheses of the search.

One step for each look-up of correspondences, no line search and no convergence test, so that all hypotheses of a batch
take the same steps. The best pose is refined further by the solver of `refine_frames`.
"""

import jax
import jax.numpy as jnp

from ..body import Pose, Skeleton
from ..refinement.parametrisations import HingedLimbs
from ..refinement.terms import CapsuleTerm, Objective, Observed, place
from ._block_normal_equations import normal_equations

# Damping of the normal matrix: absolute, for unknowns that no residual depends on, and as a share of its diagonal.
DAMPING, RELATIVE_DAMPING = 0.1, 1e-3
# Largest step of an unknown (m, rad): the linearisation is not trusted farther.
_REACH = 0.4


def descend(
    objective: Objective, parametrisation: HingedLimbs, skeleton: Skeleton, pose: Pose, observed: Observed
) -> Pose:
    """Take one damped Gauss-Newton step from the pose of one frame."""
    placed = place(skeleton, pose)
    motion = parametrisation.motion(pose, placed, skeleton)
    others = Objective({name: term for name, term in objective.terms.items() if not isinstance(term, CapsuleTerm)})
    fixed = others.correspond(placed, observed)
    value, tangent = jax.linearize(lambda body: others.residuals(body, observed, fixed), placed)
    changes = jax.vmap(tangent, -1, -1)(motion.of_body(placed))

    count = len(motion.turns)
    # One product of the stacked rows instead of one for each term.
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
    damped = matrix + jnp.diag(DAMPING + RELATIVE_DAMPING * jnp.diagonal(matrix))
    unknowns = -jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(damped, lower=True), gradient)
    return parametrisation.retract(jnp.clip(unknowns, -_REACH, _REACH), pose, skeleton)


def _by_body(terms: list[CapsuleTerm]) -> list[list[CapsuleTerm]]:
    """Group terms by body: quadrics of the same capsules are added before they are multiplied by the Jacobian."""
    groups: dict[tuple[int, ...], list[CapsuleTerm]] = {}
    for term in terms:
        # A body that passes through `jax.tree.map` is another object, but has the same arrays.
        groups.setdefault(tuple(map(id, jax.tree.leaves(term.body))), []).append(term)
    return list(groups.values())
