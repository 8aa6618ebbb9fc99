"""Calibrations of the Middlebury multi-view stereo datasets, `templeR_par.txt`: one line for each image."""

import re
from pathlib import Path, PurePosixPath

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents
from ._text import read_text, split_numbers, to_number

_NUMBERS = 21  # in a line: K and R by rows, then t
_MAX_BYTES = 2_000_000


def read_middlebury(path: Path) -> Contents:
    """Read the cameras, named after their images: the number of lines, then name, K, R and t (world to camera).

    The format has neither scale nor image size.
    """
    first, *lines = [line for line in read_text(path, _MAX_BYTES).splitlines() if line.strip()] or [""]
    if to_number(first.strip()) != len(lines):
        raise fault(
            path, None, f"says {first.strip()[:40]!r} cameras but has {len(lines)} lines of them; export it again"
        )
    return Contents("Middlebury par", [_entry(path, line) for line in lines], None, None)


def is_middlebury(text: str) -> bool:
    """Whether a text begins with a number and a line of a name and numbers."""
    found = re.match(r"\s*(\d{1,6})\s*\n\s*(\S+)[ \t]+(\S.*)", text)
    return found is not None and isinstance(to_number(found[2]), str) and len(found[3].split()) == _NUMBERS


def _entry(path: Path, line: str) -> CameraEntry:
    image, _, rest = " ".join(line.split(maxsplit=1)).partition(" ")
    name = PurePosixPath(image.replace("\\", "/")).stem
    found = split_numbers(path, name, "its line", rest, _NUMBERS)
    K, R = found[:18].reshape(2, 3, 3)
    return CameraEntry(name, K, R, found[18:], np.zeros(0), None)
