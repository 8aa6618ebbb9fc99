"""One image's people in OpenPose's JSON: ``people[].pose_keypoints_2d`` is x, y, confidence, x, y, confidence, ..."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ..files import fault, read_bounded

# A person with hands and face takes 6 kB; these are hundreds of them.
_MOST_BYTES = 4_000_000
# A person takes ten lists at most. An empty list takes thirty times the memory of its text.
_MOST_LISTS = 20_000
# Coordinates (px) beyond this are in no image.
_FARTHEST = 1e6
_REMEDY = "write the keypoints again"


def read_people(path: Path, count: int) -> Float[np.ndarray, "people keypoints 3"]:
    """Read the keypoints of all people in one image: x, y (px) and confidence; NaN where the confidence is zero.

    Args:
        path: The file.
        count: Number of keypoints of a person.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    return parse_people(path, read_bounded(path, _MOST_BYTES, "the keypoints of an image"), count)


def parse_people(path: Path, content: bytes, count: int) -> Float[np.ndarray, "people keypoints 3"]:
    """As `read_people`, of the content of a file; `path` is for messages.

    Raises:
        ValueError: The content is not what OpenPose writes; one line that names the file.
    """
    if content.count(b"[") + content.count(b"{") > _MOST_LISTS:
        raise fault(path, None, f"holds more than {_MOST_LISTS} lists, too many for one image; check the path")
    try:
        table = json.loads(content)
    except RecursionError:
        raise fault(
            path, None, "holds lists within lists, hundreds of them, and no keypoints; check the path"
        ) from None
    except ValueError as error:  # no JSON, no text, or a number of thousands of digits
        raise fault(path, None, f"is not JSON ({error}); {_REMEDY}") from None
    people = table.get("people") if isinstance(table, dict) else None
    if not isinstance(people, list):
        raise fault(path, "people", f"is missing or no list, as OpenPose writes it; {_REMEDY}")
    found = [_person(path, number, person, count) for number, person in enumerate(people)]
    return np.array([person for person in found if len(person)]).reshape(-1, count, 3)


def _person(path: Path, number: int, person: Any, count: int) -> Float[np.ndarray, "keypoints 3"]:
    """One person's keypoints; none if its list is empty."""
    key = f"people[{number}].pose_keypoints_2d"
    values = person.get("pose_keypoints_2d") if isinstance(person, dict) else None
    if not isinstance(values, list):
        raise fault(path, key, f"is missing or no list; {_REMEDY}")
    if len(values) not in (0, 3 * count):
        raise fault(
            path, key, f"holds {len(values)} numbers, but {count} keypoints take {3 * count}; give their own set"
        )
    if not all(type(value) in (int, float) for value in values):
        raise fault(path, key, f"holds something else than numbers; {_REMEDY}")
    try:
        rows = np.array(values, np.float64).reshape(-1, 3)
    except OverflowError:
        rows = np.full((1, 3), np.inf)
    if (np.abs(rows) > _FARTHEST).any():
        raise fault(path, key, f"holds a number beyond {_FARTHEST:g}, which is in no image; {_REMEDY}")
    return np.where((rows[:, 2:] > 0) & np.isfinite(rows).all(1, keepdims=True), rows, np.nan)
