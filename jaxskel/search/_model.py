"""The subject's body and the objective, prepared for the search."""

from typing import Any

import equinox as eqx
import jax
import numpy as np

from .._runtime.batching import single_precision
from ..body import BALL_NAMES, LINKS, Body, Skeleton, limb_capsules
from ..refinement.terms import GivenObjective, Objective, objective_of, search_objective
from ._limb_search import Limb, make_limb

_LIMBS = "l_arm", "r_arm", "l_leg", "r_leg"


class Model(eqx.Module):
    """The subject's body, prepared for the search.

    Attributes:
        armless: The body without arms.
        objective: The search's objective of a pose of the whole body.
    """

    body: Body
    armless: Body
    limbs: dict[str, Limb]
    objective: Objective

    @property
    def skeleton(self) -> Skeleton:
        """Skeleton of the body."""
        return self.body.skeleton


def fit_of(body: Body, objective: GivenObjective = search_objective, prior: float = 1.0) -> tuple[Body, Objective]:
    """A subject's body and the objective of it, as fits take them: without the tables of a search.

    Args:
        body: The subject's body.
        objective: An objective, or a function that makes one for the body.
        prior: Factor on the weights of priors of poses, see `Objective.with_prior`.

    Raises:
        ValueError: The objective couples frames.
    """
    return _to_fit(body, _objective_of(body, objective, prior))


def make_model(body: Body, objective: GivenObjective = search_objective, prior: float = 1.0) -> Model:
    """Prepare a subject for a search that minimises an objective; arguments and errors as of `fit_of`."""
    whole = _objective_of(body, objective, prior)
    ready, own = _to_fit(body, whole)
    body = single_precision(body)
    # The arms stay, but with negative radii, so that they touch nothing: one program fits both bodies.
    arms = limb_capsules("l_arm", "r_arm")
    balls = np.isin(np.arange(len(BALL_NAMES)), np.setdiff1d(LINKS[arms], LINKS[~arms]))
    armless = eqx.tree_at(lambda b: b.radii, body, np.where(balls, -9, body.radii))
    limbs = {name: make_limb(body.skeleton, name, whole) for name in _LIMBS}
    return Model(ready, _on_device(single_precision(armless)), _on_device(limbs), own)


def _objective_of(body: Body, objective: GivenObjective, prior: float) -> Objective:
    whole = objective_of(objective, body).with_prior(prior)
    if whole.couplings:
        raise ValueError(f"objective: a search looks at single frames, but {', '.join(whole.couplings)} couples them")
    return whole


def _to_fit(body: Body, objective: Objective) -> tuple[Body, Objective]:
    body = single_precision(body)
    return _on_device((body, single_precision(objective.of_body(body))))


def _on_device(tree: Any) -> Any:
    """The same on the device: once, instead of with each of some hundred calls."""
    return jax.tree.map(lambda leaf: jax.device_put(leaf) if hasattr(leaf, "dtype") else leaf, tree)
