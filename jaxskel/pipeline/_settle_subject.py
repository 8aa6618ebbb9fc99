"""A subject's body and its poses, adjusted together and searched for again until both settle."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float

from .._runtime.batching import length_of, padded, take
from ..body import Body, Pose, Shape, Skeleton, measured_body, shaped_skeleton
from ..body_calibration import FIRST_SCALE, bundle_adjust
from ..search import Hypotheses, fit_of, fit_pool, pool_of, prior_in_clothes
from ._prepared import Costs
from ._subject_frames import FINE, NO_PRIOR, Given, typical

STAGES = ("searching", "adjusting", "searching again", "adjusting again", "judging")
"""What `find_subject` does, one after the other."""
# The frames with the worst fits may have wrong poses; they are left out.
_USED = 0.8
THINNED = 2
"""One ray in this many is used to adjust a body, because neighbouring rays are correlated."""
# Deviation of the stature that bodies of capsules have even where outlines are many (share): the root mean square over
# 23 sequences of the bodies p00 to p07 of crowd.
_MODEL_ERROR = 0.008
# Step of the central differences of the stature (logarithm of a length).
_STEP = 1e-3
# Largest number of searches and adjustments; they end when the stature changes by less than this share. A first guess
# that is a quarter off needs more than two: each made up for a tenth.
_ROUNDS, _SETTLED = 4, 0.01
# They go on while the costs fall to less than this share of those before.
_CHEAPER = 0.9
# Up to this thickness of clothes (m), the hypotheses of the search before are fitted again to the adjusted body. Seven
# of eight naked recordings (crowd p00 to p07) got nearly the same sizes, five of them in 22 to 39 % less time. In
# clothes and with luggage, a new search finds other arms: with three cameras, 6 % of the hands were wrong, not 8 %.
_TIGHT = 0.01
# Robust scale of the first step of an adjustment that follows such a fit (m). Of 24 naked recordings (p00 to p07),
# statures were 0.7 % off and bones 1.4 % with this, with 0.03, and with the scale of the first adjustment, which takes
# twice the steps.
_NEARLY_RIGHT = 0.045


class Subject(NamedTuple):
    """A subject's body, and the poses that it was found with.

    Attributes:
        shape: Relative to the template.
        covariance: Of the logarithms of the lengths, in the order of `LENGTH_NAMES`.
        poses: Axis ``used``: the frames that count.
        stature_deviation: Standard deviation of the stature (m), to first order.
        clothes: Root mean square thickness of what the subject wears (m).
        refitted: Whether hypotheses were fitted again to an adjusted body, instead of searched for again.
    """

    shape: Shape
    body: Body
    covariance: Float[np.ndarray, "lengths=11 lengths"]
    costs: Costs
    poses: Pose
    used: Bool[np.ndarray, " frames"]
    stature_deviation: float
    clothes: float
    refitted: bool

    @property
    def cost(self) -> float:
        """What its poses typically cost: the lower, the better it explains the silhouettes."""
        return self.costs.typical


def settled(
    given: Given, shape: Shape, found: Hypotheses, on_stage: Callable[[str], None], rounds: int = _ROUNDS
) -> Subject:
    """Adjust the body and its poses, and search again with it, until neither stature nor costs change."""
    template = given.template
    before, cost = measured_body(template, shape).skeleton.stature, typical(found)
    thinned, refitted, scale = given.stack.thinned(THINNED), False, FIRST_SCALE
    for turn in range(rounds):
        on_stage(STAGES[1 if turn == 0 else 3])
        used = _well_fitted(found.cost[:, 0])
        adjusted = bundle_adjust(
            template,
            given.prior(before),
            shape,
            padded(found.best, length_of(thinned)),
            thinned,
            used,
            first_scale=scale,
        )
        shape, body = adjusted.shape, measured_body(template, adjusted.shape)
        change, before = abs(body.skeleton.stature / before - 1), body.skeleton.stature
        if turn == rounds - 1:
            break
        last, now = cost, typical(found)
        if turn > 0 and change < _SETTLED and now > _CHEAPER * last:
            break
        cost = now
        on_stage(STAGES[2])
        fits = given.refits and adjusted.clothes < _TIGHT
        refitted |= fits
        scale = _NEARLY_RIGHT if fits else FIRST_SCALE
        if fits:
            found = given.poses_from(found, shape)
        else:
            found = given.poses_of(shape, given.every) if turn == 0 else given.poses_again(found, shape)
    on_stage(STAGES[4])
    poses = take(adjusted.poses, np.flatnonzero(used))
    deviation = _stature_deviation(template, shape, adjusted.covariance)
    costs = _costs(given, body, poses, used, NO_PRIOR)
    return Subject(shape, body, adjusted.covariance, costs, poses, used, deviation, adjusted.clothes, refitted)


def with_priors(subject: Subject, given: Given) -> Subject:
    """The subject with costs of poses as the search of its frames knows them, with priors."""
    prior = prior_in_clothes(subject.clothes)
    return subject._replace(costs=_costs(given, subject.body, subject.poses, subject.used, prior))


def _costs(given: Given, body: Body, poses: Pose, used: Bool[np.ndarray, " frames"], prior: float) -> Costs:
    """What the poses of a body cost if priors of poses count `prior` times."""
    pool = pool_of(jax.tree.map(lambda a: a[:, None], poses), np.flatnonzero(used))
    fitted = fit_pool(*fit_of(body, given.search.objective, prior), pool, given.stack, FINE)
    low, median = np.quantile(fitted.cost, (0.1, 0.5))
    return Costs(float(low), float(median))


def _stature_deviation(template: Skeleton, shape: Shape, covariance: Float[np.ndarray, "lengths lengths"]) -> float:
    lengths = np.asarray(shape.lengths)

    def stature(lengths: Float[np.ndarray, " lengths"]) -> float:
        return shaped_skeleton(template, Shape(lengths, shape.fingers, shape.balls)).stature

    steps = _STEP * np.eye(len(lengths))
    slope = np.array([stature(lengths + step) - stature(lengths - step) for step in steps]) / (2 * _STEP)
    return float(np.hypot(np.sqrt(slope @ covariance @ slope), _MODEL_ERROR * stature(lengths)))


def _well_fitted(costs: Float[np.ndarray, " frames"]) -> Bool[np.ndarray, " frames"]:
    """The cheapest four fifths of the frames, rounded up: of a few frames, all."""
    return np.argsort(np.argsort(costs)) < np.ceil(_USED * len(costs))
