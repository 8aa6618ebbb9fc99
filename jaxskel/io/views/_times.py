"""Finds times in the names of images."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

# A day, then a time down to a fraction of a second: 2019-08-23_16-08-50.192, 20190823160850192.
_MOMENT = re.compile(
    r"(?<![0-9])((?:19|20)[0-9]{2})[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12][0-9]|3[01])"
    r"[-_ T.]*([01][0-9]|2[0-3])[-_.:h]?([0-5][0-9])[-_.:m]?([0-5][0-9])"
    r"(?:[-_.,s]?([0-9]{9}|[0-9]{6}|[0-9]{3}))?(?![0-9])"
)
# Seconds since some moment, with a fraction: 1699999999.123456, 0.033.
_SECONDS = re.compile(r"(?<![0-9.])([0-9]{1,12})\.([0-9]{2,9})$")
# Largest deviation of a clock's step, as a share of the usual step.
_JITTER = 0.15
# A step of more than this many usual ones is a pause.
_LONGEST = 1000


@dataclass(frozen=True)
class Times:
    """One time in each of some names.

    Attributes:
        spans: First and end position of the time in each name.
    """

    spans: tuple[tuple[int, int], ...]
    nanoseconds: tuple[int, ...]

    def holds(self, places: Sequence[int]) -> bool:
        """Whether these positions in the names lie within the times."""
        return all(first <= place < last for (first, last), place in zip(self.spans, places, strict=True))


def times_of(stems: Sequence[str]) -> Times | None:
    """The time at the same place in every name; None if there is none, or it is the same in all names."""
    for form, value, tells_time in ((_MOMENT, _moment, _are_moments), (_SECONDS, _seconds, _are_seconds)):
        found = [form.search(stem) for stem in stems]
        matches = [match for match in found if match is not None]
        if len(matches) < len(stems) or not tells_time(matches):
            continue
        values = [value(match) for match in matches]
        known = [value for value in values if value is not None]
        if len(known) == len(stems) and len(set(known)) > 1:
            return Times(tuple(match.span() for match in matches), tuple(known))
    return None


def steps_of_times(values: Sequence[int]) -> list[int]:
    """The number of each time, in steps of its clock; empty if the clock does not tick evenly."""
    order = sorted(range(len(values)), key=values.__getitem__)
    steps = np.array([values[b] - values[a] for a, b in zip(order[:-1], order[1:], strict=True)], float)
    if not len(steps) or steps.min() <= 0:
        return []
    usual = np.sort(steps)[(len(steps) - 1) // 2]
    counts = np.round(steps / usual)
    if (abs(steps / usual - counts) > _JITTER).any() or counts.min() < 1 or counts.max() > _LONGEST:
        return []
    numbers = [0] * len(values)
    for place, number in zip(order, np.concatenate([[0], np.cumsum(counts)]).astype(int).tolist(), strict=True):
        numbers[place] = number
    return numbers


def _are_moments(matches: list[re.Match[str]]) -> bool:
    """False if the apparent time of day, or fraction of a second, counts up by one as a frame number does."""
    # Digits that are the same in all names are no fraction of a second, but an image size or the like.
    end = 7 if len({match[7] for match in matches}) > 1 else 6
    last = [re.findall("[0-9]+", match.string[match.start() : match.end(end)])[-1] for match in matches]
    values = sorted(map(int, last))
    steps = [after - before for before, after in zip(values[:-1], values[1:], strict=True)]
    if min(steps, default=0) != 1 or min(map(len, last)) <= 2:
        return True
    # A time in the first hours of a day looks like a number padded with zeros.
    is_apart = all(match[7] == text for match, text in zip(matches, last, strict=True))
    return not is_apart and values[-1] >= 10 ** (len(last[0]) - 1)


def _are_seconds(matches: list[re.Match[str]]) -> bool:
    """False if the number before the point is a camera's, the same in all names, or a frame's, different in each."""
    whole = {match[1] for match in matches}
    return 1 < len(whole) < len(matches) or max(map(int, whole)) >= 10**9


def _moment(match: re.Match[str]) -> int | None:
    try:
        moment = datetime(*(int(match[part]) for part in range(1, 7)), tzinfo=UTC)
    except ValueError:  # such as the 31st of a shorter month
        return None
    return int(moment.timestamp()) * 10**9 + int((match[7] or "0").ljust(9, "0"))


def _seconds(match: re.Match[str]) -> int:
    return int(match[1]) * 10**9 + int(match[2].ljust(9, "0"))
