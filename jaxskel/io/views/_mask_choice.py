"""Decides from the values of a view's masks whether they are black and white, soft, labels, or a picture."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from ._mask_values import MOST_VALUES
from ._masks import HalfWhite, NotBackground
from ._tally import Tally

# Least share of pixels amid equal ones for values to be labels, which fill areas; grey levels between black and white
# are edges, where hardly any pixel has only equal neighbours.
_LEAST_FLAT = 0.25
# Least share of the background in masks with several labels for parts or people.
_LEAST_BACKGROUND = 0.5
# Largest share of grey pixels in a soft mask.
_MOST_GREY = 0.25
# Largest share of a person in an image; if black and white are exchanged, the background exceeds it.
_MOST_PERSON = 0.5
_REMEDY = "give them as images with a background"


@dataclass(frozen=True)
class Verdict:
    """Which values are the person.

    Attributes:
        choice: The rule; None if the values do not tell.
        told: Explanation for the user.
        person: If the values do not tell, those that may be the person; empty if the images are no masks.
        grey_share: Share of pixels that are neither dark nor bright.
        is_dim: Whether no pixel of the examined images is at least half white.
    """

    choice: HalfWhite | NotBackground | None
    told: str = ""
    person: tuple[int, ...] = ()
    grey_share: float = 0.0
    is_dim: bool = False


def verdict_of_grey(tally: Tally, lossless: bool, told: Callable[[Iterable[int]], str]) -> Verdict:
    """Judge grey levels, labels or indices."""
    tally.in_one_depth()
    values, top = sorted(tally.counts), tally.top
    present = [value for value in values if value > 0]
    grey = tally.share(lambda value: top / 8 <= value < 7 * top / 8)
    if lossless and present == [1]:
        return Verdict(NotBackground((1,)))
    if lossless and len(present) == 1 and values[0] == 0:
        if present[0] < tally.half:
            return _labels(values, told, "")
        return Verdict(HalfWhite(exact=True, white=tally.white), _too_much(tally))
    if not lossless or _is_black_and_white(tally, values, top):
        if grey > _MOST_GREY:
            return Verdict(None, f"masks hold all levels of grey, as pictures do; {_REMEDY}", grey_share=grey)
        choice = HalfWhite(white=tally.white)
        return Verdict(choice, _too_much(tally), grey_share=grey, is_dim=values[-1] < tally.half)
    if len(values) > MOST_VALUES:
        return Verdict(None, f"masks hold {told(values)}, too many to be labels, and none is white; write 0 and 255")
    is_void = values[-1] == top
    return _of_labels(tally, values, top if is_void else None, told, "not 0")


def verdict_of_colours(tally: Tally, lossless: bool, told: Callable[[Iterable[int]], str]) -> Verdict:
    """Judge colours."""
    if not lossless or len(tally.counts) > MOST_VALUES:
        return Verdict(None, f"are pictures in colour, not masks; {_REMEDY}", grey_share=1.0)
    found = _of_labels(tally, sorted(tally.counts), None, told, "not black")
    # No colour means "unknown".
    return found if found.choice is None else replace(found, choice=replace(found.choice, void=()))


def _is_black_and_white(tally: Tally, values: list[int], top: int) -> bool:
    """Whether to threshold at half white: besides black and white, there are only edges and noise."""
    if len(values) == 1:
        return True
    if values[-1] < tally.half:
        return False
    if len(values) > MOST_VALUES:
        return True
    if tally.flatness(lambda value: top / 8 <= value < 7 * top / 8) >= _LEAST_FLAT:
        return False
    # A codec that made black grey made white grey too.
    bright = sum(value >= 7 * top / 8 for value in values)
    return bright > 1 or values[0] > 0 or tally.flatness(lambda value: 0 < value < top / 8) < _LEAST_FLAT


def _of_labels(
    tally: Tally, values: list[int], void: int | None, told: Callable[[Iterable[int]], str], what: str
) -> Verdict:
    """Judge labels: the background is 0 if that is most of the masks and no value means "unknown"."""
    background = 0 if 0 in tally.counts else tally.counts.most_common(1)[0][0]
    if background == 0 and void is None and tally.share(lambda value: value == 0) >= _LEAST_BACKGROUND:
        return _labels(values, told, f"all that is {what}" if len(values) > 2 else "")
    person = tuple(value for value in values if value not in (background, void))
    return Verdict(None, f"masks hold {told(values)}; name those of the person", person or (values[-1],))


def _labels(values: list[int], told: Callable[[Iterable[int]], str], which: str) -> Verdict:
    present = tuple(value for value in values if value > 0)
    taken = which or told(present)
    said = "" if present == (255,) else f"masks hold {told(values)}: {taken} is taken for the person"
    return Verdict(NotBackground(present), said)


def _too_much(tally: Tally) -> str:
    share = tally.share(lambda value: value >= tally.half)
    if share <= _MOST_PERSON:
        return ""
    return f"{100 * share:.0f} % of the masks are white; where the person is black, write person = [0]"
