"""COLMAP's sparse model as text: `cameras.txt` and `images.txt`."""

import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...cameras import COEFFICIENTS, FISHEYE_COEFFICIENTS
from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._image_files import names_of_images
from ._text import from_quaternion, read_text, split_numbers, to_number

PAIR = ("cameras.txt", "images.txt")
# Positions of each model's parameters: focal lengths, principal point, then OpenCV's k1, k2, p1, p2, k3, ..., or for
# fisheye lenses k1, k2, k3, k4 of cv2.fisheye.
_FOCAL_LENGTHS = {
    "SIMPLE_PINHOLE": 1, "PINHOLE": 2, "SIMPLE_RADIAL": 1, "RADIAL": 1, "OPENCV": 2, "FULL_OPENCV": 2,
    "SIMPLE_FISHEYE": 1, "FISHEYE": 2, "SIMPLE_RADIAL_FISHEYE": 1, "RADIAL_FISHEYE": 1, "OPENCV_FISHEYE": 2,
}  # fmt: skip
_DISTORTIONS = {
    "SIMPLE_PINHOLE": 0, "PINHOLE": 0, "SIMPLE_RADIAL": 1, "RADIAL": 2, "OPENCV": 4, "FULL_OPENCV": 8,
    "SIMPLE_FISHEYE": 0, "FISHEYE": 0, "SIMPLE_RADIAL_FISHEYE": 1, "RADIAL_FISHEYE": 2, "OPENCV_FISHEYE": 4,
}  # fmt: skip
# COLMAP's origin is the corner of the first pixel, OpenCV's its centre.
_HALF_PIXEL = 0.5
_MOST_WORDS = 20  # of a lens; longer lines are refused without reading on


class _Lens(NamedTuple):
    K: np.ndarray
    dist: np.ndarray
    size: tuple[float, float]
    fisheye: bool


def read_colmap(folder: Path) -> Contents:
    """Read the two files of a folder: one camera for each image, whose lens several images may share.

    A camera is named after its image without the suffix, or after the image's folder if every folder holds one image.
    COLMAP has no scale and no up axis.
    """
    lenses = _lenses(folder / PAIR[0])
    path = folder / PAIR[1]
    poses = _poses(path)
    names = names_of_images(path, [pose[9] for pose in poses])
    entries = []
    for name, pose in zip(names, poses, strict=True):
        if pose[8] not in lenses:
            raise camera_fault(path, name, f"its CAMERA_ID {pose[8]} is not in {PAIR[0]}; export the model again")
        w, x, y, z, *t = split_numbers(path, name, "its pose", " ".join(pose[1:8]), 7)
        R = from_quaternion(path, name, "QW QX QY QZ", np.array([x, y, z, w]))
        lens = lenses[pose[8]]
        entries.append(CameraEntry(name, lens.K, R, np.array(t), lens.dist, lens.size, lens.fisheye))
    return Contents("COLMAP", entries, None, None)


def _words(line: str) -> Iterator[str]:
    """Iterate over the words of a line, which may have millions of them."""
    return (found[0] for found in re.finditer(r"\S+", line))


def _lenses(path: Path) -> dict[str, _Lens]:
    found = {}
    for line in read_text(path).splitlines():
        words = list(islice(_words(line), _MOST_WORDS))
        if not words or words[0].startswith("#"):
            continue
        if len(words) < 4:
            raise fault(path, None, f"is cut off: {line[:60]!r}; export the model again")
        found[words[0]] = _lens(path, f"of CAMERA_ID {words[0]}", words[1], " ".join(words[2:]))
    return found


def _lens(path: Path, camera: str, model: str, rest: str) -> _Lens:
    if model not in _FOCAL_LENGTHS:
        raise camera_fault(
            path,
            camera,
            f"has the model {model[:40]}, which is not read; use {', '.join(_FOCAL_LENGTHS)}, or undistort the images "
            "(colmap image_undistorter)",
        )
    n = _FOCAL_LENGTHS[model]
    given = split_numbers(path, camera, model, rest, 2 + n + 2 + _DISTORTIONS[model])
    (width, height), focal, (u, v) = given[:2].tolist(), given[2 : 2 + n], given[2 + n : 4 + n] - _HALF_PIXEL
    K = np.array([[focal[0], 0.0, u], [0.0, focal[-1], v], [0.0, 0.0, 1.0]])
    fisheye = model.endswith("FISHEYE")
    dist = np.zeros(FISHEYE_COEFFICIENTS if fisheye else COEFFICIENTS)
    dist[: _DISTORTIONS[model]] = given[4 + n :]
    return _Lens(K, dist, (width, height), fisheye)


def _poses(path: Path) -> list[list[str]]:
    """The words of the line of each image. A line with its points follows, which may be empty or missing."""
    found = []
    for line in read_text(path).splitlines():
        words = line.split(maxsplit=9)
        if not words or words[0].startswith("#"):
            continue
        is_pose = len(words) == 10
        count = sum(1 for _ in _words(line))
        if is_pose and all(isinstance(to_number(word), float) for word in _words(line)):
            # Points are triples, so a line of points has a multiple of three words; the ten words of a pose are none.
            is_pose = count % 3 != 0
        if is_pose:
            found.append(words)
        elif count % 3:
            raise fault(path, None, f"is cut off: {line[:60]!r}; export the model again")
    return found
