"""Damped Gauss-Newton with a fixed number of steps: what the search spends on each of its many hypotheses.

One step for each look-up of correspondences, no line search and no test of convergence: a batch of hypotheses takes
the same steps whatever its members do. The pose that wins is handed to the solver of `refine_frames`.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._skeleton import Pose, Skeleton
from .parametrisations import HingedLimbs
from .terms import CapsuleTerm, Objective, Observed, place

# Of the normal matrix: absolute, for unknowns that nothing holds, and as a share of its diagonal.
_DAMPING, _RELATIVE_DAMPING = 0.1, 1e-3
# A step is not trusted farther than this (m, rad).
_REACH = 0.4


def descend(
    objective: Objective, parametrisation: HingedLimbs, skeleton: Skeleton, pose: Pose, observed: Observed
) -> Pose:
    """Let the pose of one frame descend by one damped Gauss-Newton step."""
    placed = place(skeleton, pose)
    others = Objective({name: term for name, term in objective.terms.items() if not isinstance(term, CapsuleTerm)})
    fixed = others.correspond(placed, observed)
    groups = _by_body([term for term in objective.terms.values() if isinstance(term, CapsuleTerm)])

    def moved(unknowns: Float[Array, " unknowns"]) -> tuple[Float[Array, " rows"], list[Array]]:
        body = place(skeleton, parametrisation.nearby(unknowns, pose, skeleton))
        rows = [jnp.zeros(1), *(r.ravel() for r in others.residuals(body, observed, fixed).values())]
        return jnp.concatenate(rows), [terms[0].ends(body).reshape(-1, 6) for terms in groups]

    zeros = parametrisation.unknowns()
    (value, _), tangent = jax.linearize(moved, zeros)
    jacobian, ends = jax.vmap(tangent)(jnp.eye(len(zeros)))  # unknowns x rows, unknowns x capsules x 6
    matrix, gradient = jacobian @ jacobian.T, jacobian @ value
    for terms, change in zip(groups, ends, strict=True):
        quadrics = [(term.weight, term.quadrics(placed, observed)) for term in terms]
        inner = sum((weight * each.matrix for weight, each in quadrics), jnp.zeros(()))
        pull = sum((weight * each.vector for weight, each in quadrics), jnp.zeros(()))
        # Written out by components: rows of capsules are long enough for a processor, small matrices are not.
        parts = [change[..., i] for i in range(6)]
        pulled = [sum(part * inner[None, :, i, j] for j, part in enumerate(parts)) for i in range(6)]
        across = jnp.concatenate(parts, 1)
        matrix = matrix + jnp.concatenate(pulled, 1) @ across.T
        gradient = gradient - across @ pull.T.ravel()
    damped = matrix + jnp.diag(_DAMPING + _RELATIVE_DAMPING * jnp.diagonal(matrix))
    unknowns = -jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(damped, lower=True), gradient)
    return parametrisation.moved(jnp.clip(unknowns, -_REACH, _REACH), pose, skeleton)


def _by_body(terms: list[CapsuleTerm]) -> list[list[CapsuleTerm]]:
    """Terms of the same body together: what their capsules cost adds up before the unknowns come in."""
    groups: dict[int, list[CapsuleTerm]] = {}
    for term in terms:
        groups.setdefault(id(term.body), []).append(term)
    return list(groups.values())
