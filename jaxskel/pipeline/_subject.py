"""Who is it? Dimensions and flesh of a subject together with its poses in some frames.

Poses are searched for with a first guess of the body; then lengths, flesh and the poses of all frames are adjusted at
once. Both go on with the better body until it settles.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float

from .._runtime.batching import length_of, on_device, padded, take
from ..body import Body, Pose, Prior, Shape, Skeleton, measured_body, shaped_skeleton
from ..body_calibration import (
    FIRST_SCALE,
    Addition,
    bundle_adjust,
    dressed,
    find_luggage,
    prior_with_addition,
    usual_backpack,
    usual_hair,
    with_addition,
)
from ..search import Hypotheses, Search, fit_of, fit_pool, pool_of, prior_in_clothes
from ._prepared import Costs
from ._subject_frames import FINE, NO_PRIOR, Given, Sight

STAGES = ("searching", "adjusting", "searching again", "adjusting again", "judging")
"""What `find_subject` does, one after the other."""
OTHER_SIZES = (0.8, 1.35)
"""Sizes to try where nobody has measured the subject. The graph of a real child in wide clothes was too short by a
quarter, and no pose of that size fitted; the smaller size is for the opposite error. Nearer sizes are not needed: from
0.8, 1 and 1.3 times the graph's stature, the adjustment came to within 2.5 % of one another (crowd_01)."""
# The frames with the worst fits may have wrong poses; they are left out.
_USED = 0.8
THINNED = 3
"""One ray in this many is used to adjust a body, because neighbouring rays are correlated."""
# Deviation of the stature that bodies of capsules have even where outlines are many (share): the root mean square over
# 23 sequences of the bodies p00 to p07 of crowd.
_MODEL_ERROR = 0.008
# Step of the central differences of the stature (logarithm of a length).
_STEP = 1e-3
# Thickness of clothes that are tried, too (m). Another size must be clearly better, because a larger body also explains
# thick clothes: a real child costs 62 with the size that is right and 159 with the graph's,
# an adult in wide trousers 110 with both.
_THICK, _CLEARLY = 0.03, 0.75
# Clothes from this thickness on (m) may be a backpack that chest and arms explain, as those of a coat, a backpack and
# four cameras: `crowd_17` cost 10.2 without and 5.0 with one, and 73 and 8 % of the hands were wrong.
_HIDES_A_BAG = 0.03
# Clothes from this thickness on (m) may be hair that chest and arms explain. Hair alone is explained by the head.
_HIDES_HAIR = 0.02
# Largest number of searches and adjustments; they end when the stature changes by less than this share. A first guess
# that is a quarter off needs more than two: each made up for a tenth.
_ROUNDS, _SETTLED = 4, 0.01
# The same for a first guess. In 24 frames of twelve people (crowd p00 to p07), joints were 15.0, 13.1 and
# 13.1 mm off with one, two and three; 13.3 by the whole search for a subject, which took 5.7 s instead of 0.97.
_GUESSES = 2
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


def find_subject(
    template: Skeleton,
    prior: Callable[[float], Prior],
    sight: Sight,
    search: Search,
    sizes: tuple[float, ...] = (),
    on_stage: Callable[[str], None] = lambda _: None,
) -> Subject:
    """Find a subject's body.

    Args:
        template: Skeleton that the prior is relative to (m).
        prior: What is known before of a body of a stature (m), relative to the template.
        sight: What the frames show.
        search: Breadth and depth of the search for poses.
        sizes: Sizes to try besides the template's, as shares of it, if no body of that size fits; the silhouettes
            decide.
        on_stage: Called with each of `STAGES` as it begins.
    """
    given = Given(template, prior, sight, on_device(sight.observed), search.without_rivals())
    every = np.arange(len(sight.middles))
    on_stage(STAGES[0])
    shape = prior(template.stature).mean
    found = given.poses_of(shape, every)
    subject = _without_additions(given, shape, found, sizes, on_stage)
    # Also where the template fits: with three cameras, arms explained the whole of a backpack (`crowd_40` in clothes).
    bag = _luggage_of(subject, given)
    if bag is not None:
        given = given._replace(refits=False)
        if subject.refitted:
            subject = _without_additions(given, shape, found, sizes, on_stage)
            bag = _luggage_of(subject, given)
    usual, skeleton = prior(subject.body.skeleton.stature).mean, subject.body.skeleton
    bags = [] if bag is None else [(start, bag) for start in (subject.shape, usual)]
    if subject.clothes >= _HIDES_A_BAG:
        bags.append((usual, usual_backpack(skeleton)))
    hair = [(subject.shape, usual_hair(skeleton))] if subject.clothes >= _HIDES_HAIR else []
    first = _with_addition(subject, given, bags + hair, on_stage)
    if first is None:
        return _with_priors(subject, given)
    # Whoever has one of the two may have the other, too.
    subject, given, addition = first
    others = [(subject.shape, other) for _, other in (bags[-1:] if addition.is_hair else hair)]
    both = _with_addition(subject, given, others, on_stage)
    return _with_priors(subject, given) if both is None else _with_priors(*both[:2])


def guess_subject(
    template: Skeleton,
    prior: Callable[[float], Prior],
    sight: Sight,
    search: Search,
    sizes: tuple[float, ...] = (),
) -> Subject:
    """A first guess of a subject's body from one frame, in half a second; arguments are those of `find_subject`.

    Thick clothes, luggage and long hair are not looked for. Nor is there a wide search where poses cost much: the usual
    body fits many people badly whom their own fits well.
    """
    narrow, every = replace(search.without_rivals(), doubtful=np.inf), np.arange(len(sight.middles))
    given = Given(template, prior, sight, on_device(sight.observed, 1), narrow)

    def of_size(size: float) -> tuple[Shape, Hypotheses]:
        shape = prior(size * template.stature).mean
        return shape, given.poses_of(shape, every)

    def settled(shape: Shape, found: Hypotheses) -> Subject:
        return _settled(given, shape, found, lambda _: None, _GUESSES)

    guess = settled(*of_size(1.0))
    if sizes and _cost(guess) > search.doubtful_cost:
        other = settled(*min(map(of_size, sizes), key=lambda tried: float(tried[1].cost[0, 0])))
        guess = min(guess, other, key=_cost)
    return _with_priors(guess, given)


def _with_addition(
    without: Subject, given: Given, starts: list[tuple[Shape, Addition]], on_stage: Callable[[str], None]
) -> tuple[Subject, Given, Addition] | None:
    """The cheapest subject with one of some additions, and what is given then; None if none is worth it.

    Args:
        without: The subject without them.
        given: What does not change.
        starts: Additions, and the shapes without them to adjust each from. A shape that was found without luggage may
            hold it in its chest, so the usual one is another start: joints of `crowd_36` (seed 4 of the clothes) are
            33 mm off from the former, and 12 mm from the latter.
        on_stage: Called with each of `STAGES` as it begins.
    """
    best, least = None, np.inf
    for start, addition in starts:
        shape = with_addition(start, measured_body(given.template, start), addition)
        expects = partial(_expecting, given.prior, shape, addition)
        loaded = given._replace(prior=expects, refits=False)
        subject = _settled(loaded, shape, loaded.poses_of(shape, np.arange(len(given.sight.middles))), on_stage)
        if _cost(subject) < min(addition.worth * _cost(without), least):
            best, least = (subject, loaded, addition), _cost(subject)
    return best


def _expecting(prior: Callable[[float], Prior], shape: Shape, addition: Addition, stature: float) -> Prior:
    return prior_with_addition(prior(stature), shape, addition)


def _with_priors(subject: Subject, given: Given) -> Subject:
    """The subject with costs of poses as the search of its frames knows them, with priors."""
    prior = prior_in_clothes(subject.clothes)
    return subject._replace(costs=_costs(given, subject.body, subject.poses, subject.used, prior))


def _without_additions(
    given: Given, shape: Shape, found: Hypotheses, sizes: tuple[float, ...], on_stage: Callable[[str], None]
) -> Subject:
    if np.median(found.cost[given.tried, 0]) <= given.search.doubtful_cost:
        return _settled(given, shape, found, on_stage)
    return _of_other_sizes_and_clothes(given, shape, found, sizes, on_stage)


def _luggage_of(subject: Subject, given: Given) -> Addition | None:
    return find_luggage(subject.body, subject.poses, given.stack, np.flatnonzero(subject.used))


def _cost(subject: Subject) -> float:
    return subject.costs.typical


def _of_other_sizes_and_clothes(
    given: Given, shape: Shape, found: Hypotheses, sizes: tuple[float, ...], on_stage: Callable[[str], None]
) -> Subject:
    """The cheapest subject of all sizes, with clothes and without, where none of the template's size fits."""
    every = np.arange(len(given.sight.middles))
    best, least = shape, float(np.median(found.cost[given.tried, 0]))
    for size in sizes:
        other = given.prior(size * given.template.stature).mean
        cost = float(np.median(given.poses_of(other, given.tried).cost[:, 0]))
        if cost < _CLEARLY * least:
            best, least = other, cost
    if best is not shape:
        found = given.poses_of(best, every)
    clothed = dressed(best, _THICK)
    subjects = [
        _settled(given, start, poses, on_stage)
        for start, poses in ((best, found), (clothed, given.poses_of(clothed, every)))
    ]
    return min(subjects, key=_cost)


def _settled(
    given: Given, shape: Shape, found: Hypotheses, on_stage: Callable[[str], None], rounds: int = _ROUNDS
) -> Subject:
    """Adjust the body and its poses, and search again with it, until neither stature nor costs change."""
    template, every = given.template, np.arange(len(given.sight.middles))
    before, cost = measured_body(template, shape).skeleton.stature, float(np.median(found.cost[:, 0]))
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
        last, now = cost, float(np.median(found.cost[:, 0]))
        if turn > 0 and change < _SETTLED and now > _CHEAPER * last:
            break
        cost = now
        on_stage(STAGES[2])
        fits = given.refits and adjusted.clothes < _TIGHT
        refitted |= fits
        scale = _NEARLY_RIGHT if fits else FIRST_SCALE
        found = given.poses_from(found, shape) if fits else given.poses_of(shape, every)
    on_stage(STAGES[4])
    poses = take(adjusted.poses, np.flatnonzero(used))
    deviation = _stature_deviation(template, shape, adjusted.covariance)
    costs = _costs(given, body, poses, used, NO_PRIOR)
    return Subject(shape, body, adjusted.covariance, costs, poses, used, deviation, adjusted.clothes, refitted)


def _costs(given: Given, body: Body, poses: Pose, used: Bool[np.ndarray, " frames"], prior: float) -> Costs:
    """What the poses of a body cost if priors of poses count `prior` times."""
    pool = pool_of(jax.tree.map(lambda a: a[:, None], poses), np.flatnonzero(used))
    fitted = fit_pool(*fit_of(body, given.search.objective, prior), pool, given.stack, FINE)
    low, typical = np.quantile(fitted.cost, (0.1, 0.5))
    return Costs(float(low), float(typical))


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
