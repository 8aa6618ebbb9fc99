"""Who is it? A first guess from one frame, where nobody should wait."""

from collections.abc import Callable

from .._runtime.batching import on_device
from ..body import Prior, Shape, Skeleton
from ..search import Hypotheses, Search
from ._settle_subject import Subject, settled, with_priors
from ._subject_frames import Given, Sight

# Largest number of adjustments. In 24 frames of twelve people (crowd p00 to p07), joints were 15.0, 13.1 and
# 13.1 mm off with one, two and three; 13.3 by the whole search for a subject, which took 5.7 s instead of 0.97.
_GUESSES = 2


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
    given = Given(template, prior, sight, on_device(sight.observed, 1), search.without_rivals()).narrow

    def of_size(size: float) -> tuple[Shape, Hypotheses]:
        shape = prior(size * template.stature).mean
        return shape, given.poses_of(shape, given.every)

    def guessed(shape: Shape, found: Hypotheses) -> Subject:
        return settled(given, shape, found, lambda _: None, _GUESSES)

    guess = guessed(*of_size(1.0))
    if sizes and guess.cost > search.doubtful_cost:
        other = guessed(*min(map(of_size, sizes), key=lambda tried: float(tried[1].cost[0, 0])))
        guess = min(guess, other, key=lambda subject: subject.cost)
    return with_priors(guess, given)
