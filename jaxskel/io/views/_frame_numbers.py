"""Finds the number in the names of a camera's images that is the frame number.

It is the number that differs from image to image. Camera, person, size and date do not change; a time does, but it is
not a counter.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..files import fault
from ._times import steps_of_times, times_of

# Larger numbers are times: no camera makes this many images.
_MOST = 10**9
# Largest number of digits: a date with a time in nanoseconds has 23.
_MOST_DIGITS = 30
# With at least this many images, evenly spaced numbers that do not count by one (33, 67, 100, ...) are times.
_FEWEST_TICKS = 5
_REMEDY = "call it 000000.png, 000001.png, ..."


@dataclass(frozen=True)
class Numbered:
    """A camera's images by frame number.

    Attributes:
        notes: Notes for the user on how the images were numbered.
    """

    files: dict[int, Path]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Column:
    """A number at the same place in every name."""

    texts: tuple[str, ...]
    values: tuple[int, ...]
    is_last: bool
    is_time: bool

    @property
    def varies(self) -> bool:
        return len(set(self.values)) > 1

    @property
    def tells_apart(self) -> bool:
        return len(set(self.values)) == len(self.values)

    @property
    def order(self) -> list[int]:
        return sorted(range(len(self.values)), key=self.values.__getitem__)


def number_images(folder: Path, images: Sequence[Path]) -> Numbered:
    """Find the frame number in the names of a folder's images.

    Raises:
        ValueError: One line, if no number distinguishes the images, or two numbers do and disagree.
    """
    files = [file for file in images if re.search("[0-9]", file.stem)]
    strays = [file for file in images if file not in set(files)] if len(files) < len(images) else []
    if not files:
        raise fault(strays[0], None, f"has no frame number in its name; {_REMEDY}")
    for file in files:
        longest = max(map(len, re.findall("[0-9]+", file.stem)))
        if longest > _MOST_DIGITS:
            raise fault(
                file, None, f"has a number of {longest} digits in its name; call it 000000.png, 000001.png, ..."
            )
    notes = [f"{_some(strays)} left out: no number in the name"] if strays else []
    columns = _columns([file.stem for file in files])
    if len(files) == 1:
        number = _number_of_one(columns)
    elif not columns:
        raise fault(
            folder, None, f"names of images are of several kinds, {_two_kinds(files)}; keep one kind in the folder"
        )
    else:
        number, told = _chosen(folder, files, columns)
        notes += told
    return Numbered(dict(sorted(zip(number, files, strict=True))), tuple(notes))


def _columns(stems: list[str]) -> list[_Column]:
    """Numbers with the same text before them in every name, or the same text after them."""
    parts = [re.split("([0-9]+)", stem) for stem in stems]
    times = times_of(stems)
    found: dict[tuple[int, ...], _Column] = {}
    fewest = min(len(each) for each in parts) // 2
    for sign in (1, -1):
        for place in range(fewest):
            spots = [2 * place + 1 if sign == 1 else len(each) - 2 - 2 * place for each in parts]
            beside = {
                tuple(each[:spot:2] if sign == 1 else each[spot + 1 :: 2])
                for each, spot in zip(parts, spots, strict=True)
            }
            if len(beside) > 1:
                break
            texts = tuple(each[spot] for each, spot in zip(parts, spots, strict=True))
            values = tuple(map(int, texts))
            starts = [len("".join(each[:spot])) for each, spot in zip(parts, spots, strict=True)]
            is_time = max(values) >= _MOST or times is not None and times.holds(starts)
            is_last = all(spot == len(each) - 2 for each, spot in zip(parts, spots, strict=True))
            found.setdefault(tuple(spots), _Column(texts, values, is_last, is_time))
    return [found[spots] for spots in sorted(found)]


def _number_of_one(columns: list[_Column]) -> list[int]:
    """The frame number of a single image, where nothing varies: the number padded with zeros, or else the last one."""
    filled = [column for column in columns if re.match("0[0-9][0-9]", column.texts[0]) and not column.is_time]
    column = filled[0] if len(filled) == 1 else columns[-1]
    return [column.values[0] if column.values[0] < _MOST else 0]


def _chosen(folder: Path, files: list[Path], columns: list[_Column]) -> tuple[list[int], list[str]]:
    """The frame number of each image, and notes for the user."""
    times = _times(files, columns)
    telling = [column for column in columns if column.tells_apart and max(column.values) < _MOST]
    counters = [column for column in telling if not column.is_time] or ([] if times is not None else telling)
    best = min(map(_unevenness, counters), default=_IRREGULAR)
    if best == _IRREGULAR and times is not None:
        return _by_time(files, times)
    if not counters:
        raise _several_of_a_frame(folder, files, columns)
    fitting = [column for column in counters if _unevenness(column) == best]
    frame = min(reversed(fitting), key=lambda column: max(column.values) - min(column.values))
    rival = next((other for other in fitting if other.order != frame.order), None)
    if rival is not None:
        first = frame.order[0]
        raise fault(
            folder, None, f"two numbers in the images' names could be the frame's and give different orders, "
            f"{frame.texts[first]} and {rival.texts[first]} in {files[first].name}; keep one of them",
        )  # fmt: skip
    _check_one_person(folder, files, columns, frame)
    if best == _IRREGULAR and len(files) >= _FEWEST_TICKS and steps_of_times(frame.values):
        return _by_time(files, frame.values)
    return _unwrapped(frame)


def _times(files: list[Path], columns: list[_Column]) -> tuple[int, ...] | None:
    """Times that distinguish the images; None if there are none."""
    times = times_of([file.stem for file in files])
    if times is not None and len(set(times.nanoseconds)) == len(files):
        return times.nanoseconds
    return next((column.values for column in columns if max(column.values) >= _MOST and column.tells_apart), None)


_COUNTS, _COUNTS_WITH_GAPS, _STRIDES, _IRREGULAR = range(4)


def _unevenness(column: _Column) -> int:
    """How far the values are from a counter's."""
    steps = np.diff(np.sort(np.array(column.values)))
    if steps.min() == 1:
        return _COUNTS if steps.max() == 1 else _COUNTS_WITH_GAPS
    return _STRIDES if not (steps % steps.min()).any() else _IRREGULAR


def _unwrapped(column: _Column) -> tuple[list[int], list[str]]:
    """A counter's values; after an overflow, from 9999 to 0, the small ones are put behind the large ones."""
    width = len(column.texts[0])
    values = np.array(column.values)
    whole = 10**width
    if (
        width >= 3
        and values.min() == 0
        and values.max() == whole - 1
        and {len(text) for text in column.texts} == {width}
    ):
        ordered = np.sort(values)
        gap = int(np.argmax(np.diff(ordered)))
        if ordered[gap + 1] - ordered[gap] > whole // 2:
            return (values + whole * (values <= ordered[gap])).tolist(), [
                f"numbers in the images' names begin again at 0 after {whole - 1}: {whole} is added to these"
            ]
    return values.tolist(), []


def _check_one_person(folder: Path, files: list[Path], columns: list[_Column], frame: _Column) -> None:
    """Refuse a small number behind the frame number that varies: it may be the number of a person."""
    after = columns[columns.index(frame) + 1 :]
    if len(after) == 1 and after[0].is_last and after[0].varies and not after[0].tells_apart:
        if not after[0].is_time and max(after[0].values) < 100:
            values = after[0].texts
            other = next(place for place, value in enumerate(values) if value != values[0])
            raise _several_people(folder, files[0], files[other])


def _several_of_a_frame(folder: Path, files: list[Path], columns: list[_Column]) -> ValueError:
    """The error for images that no number distinguishes."""
    frame = max(columns, key=lambda column: (len(set(column.values)), -max(column.values)))
    for key in (list(zip(*(column.values for column in columns), strict=True)), frame.values):
        number = next((value for value, count in Counter(key).items() if count > 1), None)
        if number is not None:
            break
    first, second = [file for file, value in zip(files, key, strict=True) if value == number][:2]
    if key is frame.values:
        return _several_people(folder, first, second)
    return fault(second, None, f"is frame {frame.values[files.index(second)]}, as {first.name} is; keep one of them")


def _several_people(folder: Path, first: Path, second: Path) -> ValueError:
    return fault(
        folder, None, f"two numbers vary in the images' names, as in {first.name} and {second.name}: is one a person's "
        "or a camera's? Keep one image of a frame in the folder",
    )  # fmt: skip


def _by_time(files: list[Path], times: tuple[int, ...]) -> tuple[list[int], list[str]]:
    """Numbers in the order of times, and notes for the user; a missing clock tick leaves a missing number."""
    order = sorted(range(len(files)), key=times.__getitem__)
    even = steps_of_times(times)
    numbers = even or [order.index(place) for place in range(len(files))]
    missing = max(numbers) + 1 - len(files)
    told = f"; {missing} are missing where a step is longer" if missing else ""
    told = told if even else "; their steps are uneven: is an image missing?"
    return numbers, [f"images are numbered in the order of their times, from {files[order[0]].name} = 0{told}"]


def _some(files: list[Path]) -> str:
    more = f" and {len(files) - 1} more are" if len(files) > 1 else " is"
    return files[0].name + more


def _two_kinds(files: list[Path]) -> str:
    kinds = {re.sub("[0-9]+", "0", file.stem): file.name for file in reversed(files)}
    return " and ".join(list(reversed(kinds.values()))[:2])
