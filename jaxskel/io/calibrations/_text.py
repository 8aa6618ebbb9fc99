"""Reads untrusted text, and numbers in it."""

import re
import reprlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..files import fault, read_bounded
from ._calibration import camera_fault

# Largest file (bytes): the largest calibrations (hundreds of cameras, or COLMAP's image points) take a tenth of this.
_MAX_BYTES = 16_000_000
# No length, focal length (px) or lens coefficient comes near this; refusing it keeps later squares finite.
_MAX_NUMBER = 1e9
# Largest difference of a matrix from a rotation: files hold about six digits.
_SAME_ROTATION = 1e-3


def read_text(path: Path, most: int = _MAX_BYTES, encoding: str = "utf-8-sig", otherwise: str | None = None) -> str:
    """The text of a file of limited size; `otherwise` is the message for a file that is no text."""
    try:
        return read_bounded(path, most, "a calibration").decode(encoding)
    except UnicodeDecodeError:
        raise fault(path, None, otherwise or "is not text (UTF-8), so it is no calibration; check the path") from None


def numbers(path: Path, camera: str, key: str, value: Any, *counts: int) -> np.ndarray:
    """The numbers of a list, nested or not, of one of the given lengths (any length if none is given)."""
    found, rest = [], [value]
    while rest:
        item = rest.pop()
        if isinstance(item, list | tuple | np.ndarray):
            rest += list(item)
        elif isinstance(item, bool) or not isinstance(item, int | float) or not abs(item) < _MAX_NUMBER:
            raise camera_fault(path, camera, f"{key} holds {_short(item)}; give finite numbers")
        else:
            found.append(float(item))
    if counts and len(found) not in counts:
        wanted = " or ".join(str(count) for count in counts)
        raise camera_fault(path, camera, f"{key} holds {len(found)} numbers; give {wanted}")
    return np.array(found[::-1], np.float64)


def _short(item: Any) -> str:
    # Python refuses to print integers of thousands of digits.
    return f"a number of {item.bit_length()} bits" if isinstance(item, int) else reprlib.repr(item)


def split_numbers(path: Path, camera: str, key: str, text: str, *counts: int) -> np.ndarray:
    """The numbers of a text, separated by blanks."""
    words = text.split()
    return numbers(path, camera, key, [to_number(word) for word in words], *counts)


def to_number(word: str) -> float | str:
    """A number, or the word itself if it is none."""
    try:
        return float(word)
    except ValueError:
        return word


def rotation(path: Path, camera: str, key: str, value: Any) -> np.ndarray:
    """A rotation matrix from 3 x 3 numbers, or from a rotation vector (axis times angle in rad)."""
    found = numbers(path, camera, key, value, 3, 9)
    return found.reshape(3, 3) if len(found) == 9 else from_vector(path, camera, key, found)


def from_vector(path: Path, camera: str, key: str, vector: np.ndarray) -> np.ndarray:
    """The matrix of a rotation vector."""
    # Any rotation needs at most half a turn, and bundle adjustment may drift slightly beyond; degrees go far beyond.
    if np.linalg.norm(vector) > 2 * np.pi:
        raise camera_fault(path, camera, f"{key} is not a rotation vector in radians: {vector.tolist()}")
    return cv2.Rodrigues(vector)[0]


def nearest_rotation(path: Path, camera: str, key: str, matrix: np.ndarray) -> np.ndarray:
    """The rotation nearest to a matrix that is one up to rounding."""
    u, stretches, v = np.linalg.svd(matrix)
    if np.abs(stretches - 1).max() > _SAME_ROTATION or np.linalg.det(matrix) < 0:
        raise camera_fault(path, camera, f"{key} is not a rotation: it stretches by {stretches.round(4).tolist()}")
    return u @ v


def from_quaternion(path: Path, camera: str, key: str, xyzw: np.ndarray) -> np.ndarray:
    """The matrix of a unit quaternion (x, y, z, w)."""
    length = np.linalg.norm(xyzw)
    if abs(length - 1) > 1e-3:
        raise camera_fault(path, camera, f"{key} is not a rotation: the quaternion has length {length:.4g}, not 1")
    x, y, z, w = xyzw / length
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def to_vector(R: np.ndarray) -> np.ndarray:
    """The rotation vector of a matrix, shape (3, 1)."""
    return cv2.Rodrigues(R)[0]


def natural_order(name: str) -> list[tuple[int, int, str]]:
    """Sort key that puts cam_2 before cam_10."""
    # Limit the digits of a number, since Python refuses to convert thousands of them.
    return [(0, int(part), part) if part.isdecimal() and len(part) < 20 else (1, 0, part) for part in
            re.split(r"(\d+)", name) if part]  # fmt: skip
