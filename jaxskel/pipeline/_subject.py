"""Who is it? Dimensions and flesh of a subject together with its poses in some frames.

Poses are searched for with a first guess of the body; then lengths, flesh and the poses of all frames are adjusted at
once. Both go on with the better body until it settles.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from .._runtime.batching import on_device, take
from ..body import Prior, Shape, Skeleton, measured_body
from ..body_calibration import (
    Addition,
    dressed,
    find_luggage,
    prior_with_addition,
    usual_backpack,
    usual_hair,
    with_addition,
)
from ..search import Hypotheses, Search
from ._settle_subject import STAGES, Subject, settled, with_priors
from ._subject_frames import Given, Sight, typical

STATURES = (0.8, 2.4)
"""Lowest and highest stature that a person can have (m)."""
# Sizes to try where nobody has measured the subject, as shares of the graph's. The graph of a real child in wide
# clothes was too short by a quarter, and no pose of that size fitted; that of `crowd_46` with masks two pixels too
# narrow, without feet, was too short by a fifth, and without a size between she was taken for a person of 1.41 m. The
# smallest is for the opposite error. From 0.8, 1 and 1.3 times the graph's stature, the adjustment of `crowd_01` came
# to within 2.5 % of one another.
_OTHER_SIZES = (0.8, 1.17, 1.35)
# Thickness of clothes that are tried, too (m). Another size must be clearly better, because a larger body also explains
# thick clothes: a real child costs 62 with the size that is right and 159 with the graph's,
# an adult in wide trousers 110 with both.
_THICK, _CLEARLY = 0.03, 0.75
# Clothes from this thickness on (m) may be a backpack that chest and arms explain, as those of a coat, a backpack and
# four cameras: `crowd_17` cost 10.2 without and 5.0 with one, and 73 and 8 % of the hands were wrong.
_HIDES_A_BAG = 0.03
# Clothes from this thickness on (m) may be hair that chest and arms explain. Hair alone is explained by the head.
_HIDES_HAIR = 0.02


def other_sizes(stature: float) -> tuple[float, ...]:
    """Sizes to try besides a stature (m) that is only a guess, as shares of it: those that a person can have."""
    return tuple(size for size in _OTHER_SIZES if STATURES[0] < size * stature < STATURES[1])


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
    on_stage(STAGES[0])
    shape = prior(template.stature).mean
    found = given.poses_of_all(shape, given.poses_of(shape, given.tried))
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
    hair = [(subject.shape, usual_hair(skeleton))]
    hidden = hair if subject.clothes >= _HIDES_HAIR else []
    first = _with_addition(subject, given, bags + hidden, on_stage)
    if first is None and bag is not None and not hidden:
        # What is behind the back and no bag may be hair: of a heavy body (p12), it cost 0.44 of what it did without.
        first = _with_addition(subject, given, hair, on_stage)
    if first is None:
        return with_priors(subject, given)
    # Whoever has one of the two may have the other, too.
    subject, given, addition = first
    others = [(subject.shape, other) for _, other in (bags[-1:] if addition.is_hair else hidden)]
    both = _with_addition(subject, given, others, on_stage)
    return with_priors(subject, given) if both is None else with_priors(*both[:2])


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
        subject = settled(loaded, shape, loaded.narrow.poses_of(shape, given.every), on_stage)
        if subject.cost < min(addition.worth * without.cost, least):
            best, least = (subject, loaded, addition), subject.cost
    return best


def _expecting(prior: Callable[[float], Prior], shape: Shape, addition: Addition, stature: float) -> Prior:
    return prior_with_addition(prior(stature), shape, addition)


def _without_additions(
    given: Given, shape: Shape, found: Hypotheses, sizes: tuple[float, ...], on_stage: Callable[[str], None]
) -> Subject:
    if typical(take(found, given.tried)) <= given.search.doubtful_cost:
        return settled(given, shape, found, on_stage)
    return _of_other_sizes_and_clothes(given, shape, found, sizes, on_stage)


def _luggage_of(subject: Subject, given: Given) -> Addition | None:
    return find_luggage(subject.body, subject.poses, given.stack, np.flatnonzero(subject.used))


def _of_other_sizes_and_clothes(
    given: Given, shape: Shape, found: Hypotheses, sizes: tuple[float, ...], on_stage: Callable[[str], None]
) -> Subject:
    """The cheapest subject of all sizes, with clothes and without, where none of the template's size fits."""
    tried = take(found, given.tried)
    best, least = shape, typical(tried)
    for size in sizes:
        other = given.prior(size * given.template.stature).mean
        # Half of these frames tell whether it may be better; most sizes are not, and a wide search takes long.
        if typical(given.poses_of(other, given.tried[::2])) >= least:
            continue
        poses = given.poses_of(other, given.tried)
        if typical(poses) < _CLEARLY * least:
            best, least, tried = other, typical(poses), poses
    if best is not shape:
        found = given.poses_of_all(best, tried)
    clothed = dressed(best, _THICK)
    # Widely: found narrowly, a real child costs 58 with its final body, and 54 so.
    in_clothes = given.poses_of(clothed, given.every)
    subjects = [settled(given, start, poses, on_stage) for start, poses in ((best, found), (clothed, in_clothes))]
    return min(subjects, key=lambda subject: subject.cost)
