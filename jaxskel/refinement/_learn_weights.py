"""Learn the weights of an objective from a few labelled frames, by differentiating through the refinement."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .._runtime.batching import single_precision
from ..body import Pose, Skeleton
from ._arguments import check_frames
from ._frames import Solver, refine_frames
from .parametrisations import Parametrisation
from .solvers import NormalEquationsLM
from .terms import Objective, Observed

# The loss is quadratic for errors much smaller than this (m) and linear for larger ones, so that one misplaced hand
# does not dominate it.
_SMALL = 0.01
# Each weight stays within 100x of its start: a few frames do not support larger changes.
_MOST = 100.0
# Penalty (m) on the squared logarithm of each weight's change: weights that make no difference stay.
_HOLD = 1e-5


class Learned(eqx.Module):
    """An objective with learned weights, and its errors during learning.

    Attributes:
        losses: Mean error of the labelled joints (m, quadratic below a centimetre) of each objective tried, in order.
        converged: Frames whose last solve converged; only these have a gradient and take part in the learning.
    """

    objective: Objective
    losses: Float[np.ndarray, " evaluations"]
    converged: Bool[np.ndarray, " frames"]

    @property
    def weights(self) -> dict[str, float]:
        """Learned weights, by name of the term."""
        return {name: float(term.weight) for name, term in self.objective.terms.items()}


def learn_weights(
    objective: Objective,
    parametrisation: Parametrisation,
    skeleton: Skeleton,
    initial: Pose,
    observed: Observed,
    labels: Float[np.ndarray, "frames joints 3"],
    solver: Solver | None = None,
    rounds: int = 3,
    max_steps: int = 100,
    iterations: int = 20,
) -> Learned:
    """Choose the weights that bring the refined joints nearest to labels, by L-BFGS on the logarithms of the weights.

    The gradient comes from the implicit function theorem, which holds where a solve has converged.

    Args:
        objective: Terms with their start weights. Only the ratios of the weights matter.
        parametrisation: How a pose is written as unknowns.
        skeleton: Template (m).
        initial: Start poses (m, in the world), with a leading frames axis.
        observed: Graph and outlines (m, in the world), with a leading frames axis.
        labels: True joints (m, in the world of `initial`), NaN where unknown.
        solver: By default Levenberg-Marquardt to 0.01 mm: a solve that has not converged has no gradient.
        rounds: How often correspondences are looked up again.
        max_steps: Largest number of solver steps in each round.
        iterations: Largest number of L-BFGS iterations.

    Raises:
        ValueError: No joint is labelled, or no frame converges.
    """
    from scipy.optimize import minimize  # imported here, because it takes a while and is needed here only

    solver = NormalEquationsLM(rtol=1e-4, atol=1e-5) if solver is None else solver
    check_frames(objective, parametrisation, solver, skeleton, initial, observed, rounds, max_steps)
    if np.shape(labels) != (len(initial.root), 15, 3):
        raise ValueError(f"labels: have shape {np.shape(labels)}; give ({len(initial.root)}, 15, 3), NaN where unknown")
    if not np.isfinite(labels).all(-1).any():
        raise ValueError("labels: every joint is NaN; give true joints (m) of a few frames")
    names = sorted(objective.terms)  # the order in which JAX stores them
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
    """Stacks in which a good frame replaces each other frame, whose gradient would not be finite."""
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
    """Loss (m) and which frames converged, and the gradient of the loss."""

    def loss(logarithms: Float[Array, " terms"]) -> tuple[Array, tuple[Array, Array]]:
        objective, skeleton, initial, observed, labels = given
        names = sorted(objective.terms)
        scaled = {name: objective.terms[name].weight * jnp.exp(logarithms[i]) for i, name in enumerate(names)}
        changed = objective.weighted(**scaled)
        found = refine_frames(changed, parametrisation, solver, skeleton, initial, observed, rounds, max_steps)
        known = jnp.isfinite(labels).all(-1)
        # All frames count, so that a frame that ceases to converge does not lower the loss; it only has no gradient.
        joints = jnp.where(found.converged[:, None, None], found.joints, jax.lax.stop_gradient(found.joints))
        apart = jnp.where(known[..., None], joints - labels, 0.0)
        errors = jnp.sqrt((apart**2).sum(-1) + _SMALL**2) - _SMALL
        value = errors.sum() / jnp.maximum(known.sum(), 1) + _HOLD * (logarithms**2).sum()
        return value, (value, found.converged)

    # Forward mode: there are few weights, and no reverse pass through the solver is needed.
    slope, found = jax.jacfwd(loss, has_aux=True)(logarithms)
    return found, slope
