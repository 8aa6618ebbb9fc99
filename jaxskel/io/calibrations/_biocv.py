"""Calibrations of the BioCV dataset (University of Bath): one text of numbers for each camera."""

import os
import re
from pathlib import Path

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._folder import sorted_files
from ._text import nearest_rotation, read_text, split_numbers

SUFFIX = ".calib"
_VIDEO = r"\.(mp4|avi|mov|mkv|m4v|mpg)"
_MILLIMETRE = 0.001
# Numbers in a file: width, height, K and the pose by rows, then four or five lens coefficients.
_COUNTS = (31, 32)
_MAX_BYTES = 20_000


def read_biocv(path: Path) -> Contents:
    """Read a file, or all `.calib` files of a folder; `00.mp4-mocAligned.calib` is the camera `00`.

    The world is that of the motion capture, in millimetres with Z up. The 3 x 3 block of the pose is a rotation times a
    factor near 0.998. The translation is divided by it too, which does not change the projection of a point.
    """
    files = sorted_files(path, SUFFIX) if os.path.isdir(path) else [path]
    return Contents("BioCV", [_entry(file) for file in files], _MILLIMETRE, "+Z")


def is_biocv(text: str) -> bool:
    """Whether the lines of a text have the same numbers of words as a file of BioCV."""
    counts = [len(line.split()) for line in text.splitlines() if line.strip()]
    return counts[:-1] == [1, 1, 3, 3, 3, 4, 4, 4, 4] and counts[-1] in (4, 5)


def _entry(path: Path) -> CameraEntry:
    name = re.sub(rf"({_VIDEO}(-\w+)?)?{re.escape(SUFFIX)}$", "", path.name, flags=re.IGNORECASE)
    text = read_text(path, _MAX_BYTES)
    if not is_biocv(text):
        raise fault(path, None, "is no calibration of BioCV: width, height, K, a pose of 4 x 4 and the lens, in lines")
    found = split_numbers(path, name, "the file", text, *_COUNTS)
    (width, height), K, pose, dist = found[:2].tolist(), found[2:11], found[11:27].reshape(4, 4), found[27:]
    scale = np.cbrt(np.linalg.det(pose[:3, :3]))
    if not 1e-6 < scale < 1e6 or not np.allclose(pose[3], [0, 0, 0, 1]):
        raise camera_fault(path, name, "its pose is no rotation times a number, with a last row of 0 0 0 1")
    R = nearest_rotation(path, name, "its pose", pose[:3, :3] / scale)
    return CameraEntry(name, K.reshape(3, 3), R, pose[:3, 3] / scale, dist, (width, height))
