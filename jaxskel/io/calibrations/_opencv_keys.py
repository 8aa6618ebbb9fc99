r"""The key names that people use for a camera in OpenCV's FileStorage, which prescribes none.

OpenCV's calibration sample writes ``camera_matrix`` and ``distortion_coefficients``. People add the pose, and often all
the rest, by hand: ``CameraMatrix``, ``DistortionCoeffs``, ``RotationValues``; ``mtx``, ``dist``, ``rvecs``.
Punctuation, capitals and plurals are ignored.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ._calibration import camera_fault
from ._opencv_yaml import Value

# Largest relative difference between duplicates, which may be in single precision or another form of rotation.
_SAME = 1e-3


@dataclass(frozen=True)
class Part:
    """A part of a camera.

    Attributes:
        names: Pattern of its names, without punctuation and capitals.
        examples: The most common names, for messages.
    """

    names: re.Pattern[str]
    examples: str


_CAMERA = r"(cameras?|cam)?"
_NUMBERS = r"(matrix|matrices|mat|mtx|vec(tor)?s?|values?|coeff?s?|coefficients?|param(eter)?s?)?"

MATRIX = Part(
    re.compile(rf"k|m|{_CAMERA}(intrinsics?|intr){_NUMBERS}|{_CAMERA}(matrix|mat|mtx)(intrinsics?)?"), "camera_matrix"
)
LENS = Part(re.compile(rf"d|{_CAMERA}(lens)?dist(ort(ion)?)?s?{_NUMBERS}"), "distortion_coefficients")
ROTATION = Part(
    re.compile(rf"{_CAMERA}(r|rot|rotations?|rodrigues){_NUMBERS}"), "R or rotation_matrix or rotation or rvec"
)
TRANSLATION = Part(
    re.compile(rf"{_CAMERA}(t|trans|translations?){_NUMBERS}"), "T or t or translation_vector or translation or tvec"
)
_IMAGE = r"(image|img|frame|video|camera)?"
WIDTH = Part(re.compile(rf"{_IMAGE}width"), "image_width")
HEIGHT = Part(re.compile(rf"{_IMAGE}height"), "image_height")
SIZE = Part(re.compile(rf"{_IMAGE}(size|resolution)"), "image_size")


def keys_of(found: dict[str, Value], part: Part) -> list[str]:
    """The keys of a file that match a part of a camera."""
    return [key for key in found if part.names.fullmatch(re.sub(r"[^a-z0-9]", "", key.lower()))]


def part_of(
    path: Path, name: str, found: dict[str, Value], part: Part, read: Callable[[str, Value], np.ndarray]
) -> np.ndarray:
    """The numbers of a required part. If it occurs under several names, they must agree."""
    keys = keys_of(found, part)
    if not keys:
        raise camera_fault(
            path,
            name,
            f"{part.examples} is missing; add it (the pose of the camera in the world is needed too); there are "
            f"{', '.join(found) or 'no keys'}",
        )
    values = {key: read(key, found[key]) for key in keys}
    first = values[keys[0]]
    for key, value in values.items():
        if value.shape != first.shape or (np.abs(value - first) > _SAME * max(np.abs(first).max(initial=0), 1)).any():
            raise camera_fault(path, name, f"{keys[0]} and {key} are both there and differ; keep one")
    return first
