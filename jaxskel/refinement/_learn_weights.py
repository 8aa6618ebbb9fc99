"""Weights of an objective, learned from a few labelled frames: gradients go through the refinement."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._runtime.batching import single_precision
from ..body import Pose, Skeleton
from ._frames import Solver, refine_frames
from .parametrisations import Parametrisation
from .solvers import NormalEquationsLM
from .terms import Objective, Observed

# Errors much smaller than this count by their square, larger ones by themselves (m): one lost hand is not everything.
_SMALL = 0.01
# No weight becomes so many times larger or smaller: what a few frames say of it is not that sure.
_MOST = 100.0
# Of the squared logarithm of a weight's change, relative to metres: only what makes a difference changes.
_HOLD = 1e-5


class Learned(eqx.Module):
    """An objective whose weights were learned, and how well it did."""

    objective: Objective
    losses: Float[np.ndarray, " evaluations"]
    """Mean error of the labelled joints (m, smooth below a centimetre) of each objective tried, in order."""
    converged: Bool[np.ndarray, " frames"]
    """Frames whose last solve converged; only these have a gradient, and only these are learned from."""

    @property
    def weights(self) -> dict[str, float]:
        """By name of the term."""
        return {name: float(term.weight) for name, term in self.objective.terms.items()}


def learn_weights(
    objective: Objective,
    parametrisation: Parametrisation,
    skeleton: Skeleton,
    initial: Pose,
    observed: Observed,
    labels: Float[np.ndarray, "frames joints=15 3"],
    solver: Solver | None = None,
    rounds: int = 3,
    max_steps: int = 100,
    iterations: int = 20,
) -> Learned:
    """Choose the weights with which the refined joints come nearest to labels, by L-BFGS on their logarithms.

    The gradient is that of the implicit function theorem: it holds where a solve has converged.

    Args:
        objective: Terms with the weights to start from. Only their ratios matter.
        parametrisation: How a pose is written as unknowns.
        skeleton: Template.
        initial: Poses to start from, with a leading frames axis.
        observed: What was measured, with a leading frames axis.
        labels: True joints (m, in the world of `initial`), NaN where unknown.
        solver: By default Levenberg-Marquardt to a hundredth of a millimetre: what has not converged has no gradient.
        rounds: How often correspondences are looked up again.
        max_steps: Steps of the solver in each round.
        iterations: Of L-BFGS, at most.

    Raises:
        ValueError: No joint is labelled, or no frame converges.
    """
    from scipy.optimize import minimize  # takes a while to import, and is needed here only

    if not np.isfinite(labels).all(-1).any():
        raise ValueError("labels: every joint is NaN; give true joints (m) of a few frames")
    solver = solver or NormalEquationsLM(rtol=1e-4, atol=1e-5)
    names = sorted(objective.terms)  # as JAX orders them
    start = np.array([float(objective.terms[name].weight) for name in names])
    options = parametrisation, solver, rounds, max_steps
    problem = single_precision((objective, skeleton, initial, observed, np.asarray(labels)))
    changed, template, poses, seen, goals = problem
    found = refine_frames(changed, parametrisation, solver, template, poses, seen, rounds, max_steps)
    converged = np.asarray(found.converged)
    if not converged.any():
        raise ValueError("no frame converges, so that none has a gradient: give better poses or more max_steps")
    poses, seen = _in_place_of_others((poses, seen), converged)
    goals = np.where(converged[:, None, None], goals, np.nan)
    given = jax.tree.map(jnp.asarray, (changed, template, poses, seen, goals))
    losses: list[float] = []
    outcomes: list[np.ndarray] = []

    def evaluate(logarithms: np.ndarray) -> tuple[float, np.ndarray]:
        (value, ended), slope = _loss_and_slope(jnp.asarray(logarithms, jnp.float32), given, *options)
        losses.append(float(value))
        outcomes.append(np.asarray(ended) & converged)
        return float(value), np.asarray(slope, float)

    bound = float(np.log(_MOST))
    found = minimize(
        evaluate, np.zeros(len(start)), jac=True, method="L-BFGS-B", bounds=[(-bound, bound)] * len(start),
        options={"maxiter": iterations, "maxfun": 3 * iterations},
    )  # fmt: skip
    best = dict(zip(names, start * np.exp(found.x), strict=True))
    return Learned(objective.weighted(**best), np.array(losses), outcomes[int(np.argmin(losses))])


def _in_place_of_others(frames: Any, good: Bool[np.ndarray, " frames"]) -> Any:
    """Stacks with one of the good frames in place of each other one, whose gradient would be none at all."""
    index = np.where(good, np.arange(len(good)), int(np.argmax(good)))
    return jax.tree.map(lambda a: np.asarray(a)[index], frames)


@eqx.filter_jit
def _loss_and_slope(
    logarithms: Float[Array, " terms"],
    given: tuple[Objective, Skeleton, Pose, Observed, Array],
    parametrisation: Parametrisation,
    solver: Solver,
    rounds: int,
    max_steps: int,
) -> tuple[tuple[Array, Array], Array]:
    """Mean error (m) and which frames converged, and the slope of the error."""

    def loss(logarithms: Float[Array, " terms"]) -> tuple[Array, tuple[Array, Array]]:
        objective, skeleton, initial, observed, labels = given
        names = sorted(objective.terms)
        scaled = {name: objective.terms[name].weight * jnp.exp(logarithms[i]) for i, name in enumerate(names)}
        changed = objective.weighted(**scaled)
        found = refine_frames(changed, parametrisation, solver, skeleton, initial, observed, rounds, max_steps)
        known = jnp.isfinite(labels).all(-1)
        # All of them count, so that nothing is gained by a frame that ceases to converge; it just has no slope.
        joints = jnp.where(found.converged[:, None, None], found.joints, jax.lax.stop_gradient(found.joints))
        apart = jnp.where(known[..., None], joints - labels, 0.0)
        errors = jnp.sqrt((apart**2).sum(-1) + _SMALL**2) - _SMALL
        value = errors.sum() / jnp.maximum(known.sum(), 1) + _HOLD * (logarithms**2).sum()
        return value, (value, found.converged)

    # Forwards: there are few weights, and nothing need be turned round.
    slope, found = jax.jacfwd(loss, has_aux=True)(logarithms)
    return found, slope
