"""The calibration of the TotalCapture dataset, `calibration.cal`: lines of numbers."""

from pathlib import Path

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._text import read_text, split_numbers

_LINES = 7  # for each camera: bounds, intrinsics, lens, three rows of R, t
_MOST_CAMERAS = 1000
# Coefficients of the radial polynomial: OpenCV's k1, k2 and, after the two tangential ones, k3.
_MOST_COEFFICIENTS = 3
_MAX_BYTES = 1_000_000


def read_totalcapture(path: Path) -> Contents:
    """Read the cameras, named cam1, cam2, ... like the dataset's videos.

    The first line holds the numbers of cameras and of radial coefficients. For each camera follow the first and last
    row and column of its image; fx, fy, cx and cy (px); the coefficients; R and t from world to camera, in metres.
    """
    lines = _lines(read_text(path, _MAX_BYTES)) or [""]
    claimed = split_numbers(path, "of all", "the first line", lines[0], 2).tolist()
    if claimed[0] not in range(1, _MOST_CAMERAS + 1) or claimed[1] not in range(_MOST_COEFFICIENTS + 1):
        raise fault(
            path, None, f"claims {claimed[0]:g} cameras with {claimed[1]:g} coefficients; three are read at most"
        )
    count, order = (int(number) for number in claimed)
    if len(lines) != 1 + _LINES * count:
        raise fault(path, None, f"claims {count} cameras, {_LINES} lines each, but has {len(lines) - 1} lines of them")
    entries = [_entry(path, f"cam{i + 1}", lines[1 + _LINES * i :][:_LINES], order) for i in range(count)]
    return Contents("TotalCapture", entries, 1.0, None)


def is_totalcapture(text: str) -> bool:
    """Whether the lines of a text have the same numbers of words as a file of TotalCapture."""
    counts = [len(line.split()) for line in _lines(text[:_MAX_BYTES])[: 1 + _LINES]]
    return counts[:3] == [2, 4, 4] and counts[4:] == [3, 3, 3, 3]


def _lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if line.strip()]


def _entry(path: Path, name: str, lines: list[str], order: int) -> CameraEntry:
    keys = ("bounds", "fx fy cx cy", "distortion", "R", "t")
    texts = (*lines[:3], " ".join(lines[3:6]), lines[6])
    counts = (4, 4, max(order, 1), 9, 3)
    top, bottom, left, right = split_numbers(path, name, keys[0], texts[0], counts[0]).tolist()
    if top != 0 or left != 0:
        raise camera_fault(path, name, f"bounds {texts[0]} are those of a part of the image; give the whole, from 0")
    (fx, fy, cx, cy), radial, R, t = (
        split_numbers(path, name, key, text, n) for key, text, n in zip(keys[1:], texts[1:], counts[1:], strict=True)
    )
    dist = np.zeros(5)
    dist[[0, 1, 4][: len(radial)]] = radial
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return CameraEntry(name, K, R.reshape(3, 3), t, dist, (right + 1, bottom + 1))
