"""Reads untrusted JSON."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from ..files import fault
from ._calibration import camera_fault
from ._text import numbers, read_text

# Largest number of lists. A camera takes a hundred numbers in twenty lists; an empty list takes thirty times the memory
# of its text.
_MOST_LISTS = 500_000
# Largest number of cameras: four times that of the Panoptic Studio.
_MOST_CAMERAS = 2000


def read_json(path: Path) -> Any:
    """Parse a JSON file of limited size; an object with a repeated key is refused."""

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            counts = Counter(key for key, _ in pairs)
            raise fault(path, counts.most_common(1)[0][0][:60], "is there twice; keep one")
        return found

    text = read_text(path)
    if text.count("[") + text.count("{") > _MOST_LISTS:
        raise fault(path, None, f"holds more than {_MOST_LISTS} lists, too many for a calibration; check the path")
    try:
        return json.loads(text, object_pairs_hook=unique)
    except json.JSONDecodeError as error:
        raise fault(path, None, f"is not JSON ({error}); export the calibration again") from None
    except RecursionError:
        raise fault(path, None, "is not a calibration: lists within lists, hundreds of them; check the path") from None
    except ValueError as error:  # one of our own errors, or a number of thousands of digits
        if str(error).startswith(str(path)):
            raise
        raise fault(path, None, f"is not JSON ({error}); export the calibration again") from None


def table_of(path: Path, camera: str, key: str, value: Any) -> dict[str, Any]:
    """Check that a value is an object."""
    if not isinstance(value, dict):
        raise camera_fault(path, camera, f"{key} is missing or no object with keys; export the calibration again")
    return value


def given(path: Path, camera: str, table: dict[str, Any], key: str, *counts: int) -> np.ndarray:
    """The numbers of a required key, of one of the given lengths."""
    if key not in table:
        raise camera_fault(path, camera, f"{key} is missing; export the calibration again")
    return numbers(path, camera, key, table[key], *counts)


def check_count(path: Path, count: int) -> None:
    """Refuse more cameras than any rig has, before processing each."""
    if count > _MOST_CAMERAS:
        raise fault(path, None, f"holds {count} cameras; give a calibration of at most {_MOST_CAMERAS}")
