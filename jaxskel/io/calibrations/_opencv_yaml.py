"""Reads and writes the subset of YAML that OpenCV's FileStorage writes.

OpenCV's own reader aborts the process on hostile text, and general YAML readers reject its matrices.
"""

import re
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from ..files import fault
from ._text import read_text, to_number

_TAG = re.compile(r"^!!\S+\s*")
# Largest number of values: a calibration has few for each camera; this allows the board corners of a thousand images.
_MOST_NUMBERS = 1_000_000


@dataclass(frozen=True)
class Matrix:
    """Numbers in rows."""

    rows: int
    columns: int
    data: list[float | str]


Value = Matrix | list[float | str] | float | str


def read_opencv_yaml(path: Path) -> dict[str, Value]:
    """The content by name: matrices, lists and single values."""
    found = {}
    for key, lines in yaml_blocks(path).items():
        found[key] = _value(path, key, lines)
    return found


def checked_matrix(path: Path, key: str, rows: int, columns: int, data_type: str, data: list[float | str]) -> Matrix:
    """A matrix, after checking that it has as many numbers as it claims.

    ``data_type`` is OpenCV's, such as ``d``, or ``2f`` if each element is a pair; a row then holds all its numbers.
    """
    channels = re.match(r"\d{1,2}", data_type)
    columns *= int(channels[0]) if channels else 1
    if rows * columns != len(data):
        raise fault(path, key, f"claims {rows} x {columns} numbers but holds {len(data)}; export it again")
    return Matrix(rows, columns, data)


def words_of(path: Path, key: str, text: str, pattern: str = r"\S+") -> list[float | str]:
    """The numbers of a text that may have millions of words."""
    words = [found[0] for found in islice(re.finditer(pattern, text), _MOST_NUMBERS + 1)]
    if len(words) > _MOST_NUMBERS:
        raise fault(path, key, f"holds more than {_MOST_NUMBERS} numbers, too many for a calibration")
    return [scalar(word) for word in words]


def scalar(text: str) -> float | str:
    """A number, or text without its quotes; quoted digits stay text, since they name a camera."""
    if len(text) > 1 and text[0] == text[-1] and text[0] in "\"'":
        return text[1:-1]
    lower = text.lower()
    return to_number(text) if lower not in (".nan", ".inf", "-.inf") else float(lower.replace(".", ""))


def yaml_matrix(key: str, matrix: np.ndarray) -> list[str]:
    """The lines of a matrix as OpenCV writes them, with enough digits to read back the same numbers."""
    rows, columns = matrix.shape
    data = ", ".join(repr(float(x)) for x in matrix.reshape(-1))
    return [
        f"{key}: !!opencv-matrix",
        f"   rows: {rows}",
        f"   cols: {columns}",
        "   dt: d",
        f"   data: [ {data} ]",
    ]


def yaml_blocks(path: Path) -> dict[str, list[str]]:
    """For each name of the file, the rest of its line and the indented lines below."""
    blocks: dict[str, list[str]] = {}
    lines: list[str] | None = None
    for line in read_text(path).splitlines():
        if not line.strip() or line.lstrip().startswith("#") or line.startswith(("%", "---", "...")):
            continue
        # List items below their name need not be indented.
        if line[0] in " \t-" or line.strip() in ("]", "}"):
            if lines is None:
                raise fault(path, None, "begins with a line that is set in; give YAML as OpenCV writes it")
            lines.append(line.strip())
            continue
        key, colon, rest = line.partition(":")
        key = key.strip().strip("\"'")
        if not key or not colon or rest[:1].strip():
            raise fault(path, None, f"is not YAML as OpenCV writes it: {line[:60]!r}; export it again")
        if key in blocks:
            raise fault(path, key[:60], "is there twice; keep one")
        lines = blocks[key] = [rest.strip()]
    return blocks


def _value(path: Path, key: str, lines: list[str]) -> Value:
    lines = [line for line in (_TAG.sub("", lines[0]), *lines[1:]) if line]
    if any(line.startswith("rows:") for line in lines):
        return _matrix(path, key, lines)
    if lines and lines[0].startswith("["):
        return _items(path, key, " ".join(lines))
    if lines and lines[0].startswith("- "):
        # Camera names, which may be unquoted digits: do not convert them to numbers.
        return [line.removeprefix("-").strip().strip("\"'") for line in lines]
    return scalar(" ".join(lines))


def _matrix(path: Path, key: str, lines: list[str]) -> Matrix:
    text = " ".join(lines)
    counts = [re.search(rf"\b{word}:\s*(\d{{1,7}})\b", text) for word in ("rows", "cols")]
    start = text.find("data:")
    if None in counts or start < 0:
        raise fault(path, key, "is no matrix of rows, cols and data; export it again")
    rows, columns = (int(count.group(1)) for count in counts if count is not None)
    data_type = re.search(r"\bdt:\s*[\"']?(\w+)", text[:start])
    data = _items(path, key, text[start + len("data:") :].strip())
    return checked_matrix(path, key, rows, columns, data_type[1] if data_type else "d", data)


def _items(path: Path, key: str, text: str) -> list[float | str]:
    # Nested lists, which OpenCV does not write, are flattened; the caller checks the length.
    if not text.endswith("]"):
        raise fault(path, key, "is cut off: a list without its end; export it again")
    return words_of(path, key, text, r"[^,\s\[\]]+")
