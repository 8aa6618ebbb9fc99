"""Reads the JSON that OpenCV's FileStorage writes."""

import json
from pathlib import Path
from typing import Any

from ..files import fault
from ._opencv_yaml import Value, checked_matrix
from ._text import read_text

MARK = "opencv-matrix"


def read_opencv_json(path: Path) -> dict[str, Value]:
    """The content by name: matrices, lists and single values. Nested objects are left out."""
    try:
        table = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise fault(path, None, f"is not JSON ({error}); export it again") from None
    if not isinstance(table, dict):
        raise fault(path, None, "is no JSON of OpenCV, which has names in braces; export it again")
    found: dict[str, Value] = {}
    for key, value in table.items():
        if not isinstance(value, dict):
            found[key] = [_scalar(item) for item in value] if isinstance(value, list) else _scalar(value)
        elif value.get("type_id") == MARK:
            found[key] = _matrix(path, key, value)
    return found


def _matrix(path: Path, key: str, value: dict[str, Any]) -> Value:
    counts, data = [value.get(word) for word in ("rows", "cols")], value.get("data")
    known = [count for count in counts if type(count) is int and 0 <= count < 10**7]
    if not isinstance(data, list) or len(known) < 2:
        raise fault(path, key, "is no matrix of rows, cols and data; export it again")
    data = [_scalar(item) for item in data]
    return checked_matrix(path, key, *known, data_type=str(value.get("dt", "d"))[:10], data=data)


def _scalar(item: Any) -> float | str:
    """A number or text; anything else becomes the name of its type, which is refused where a number is needed."""
    if isinstance(item, bool):
        return str(item).lower()
    # Python cannot convert integers of hundreds of digits to float, nor print those of thousands.
    if isinstance(item, int):
        return float(item) if item.bit_length() < 64 else f"a number of {item.bit_length()} bits"
    return item if isinstance(item, float | str) else type(item).__name__
