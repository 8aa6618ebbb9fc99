"""Reads the lens of a camera in hand-written JSON, under the usual keys."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ._calibration import camera_fault
from ._json import given
from ._text import numbers

_MATRICES = (
    "K", "intrinsic", "intrinsics", "intrinsic_matrix", "camera_matrix", "cameraMatrix", "cam_matrix", "mtx", "matrix",
    "in_mat",
)  # fmt: skip
_LISTS = (
    "dist", "distortion", "distortions", "distCoef", "distCoeff", "distCoeffs", "dist_coef", "dist_coeff",
    "dist_coeffs", "distortion_coefficients", "distortion_coeffs", "D", "d",
)  # fmt: skip
# In OpenCV's order.
_COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
_MODELS = ("distortion_model", "camera_model", "lens_model", "model", "camera_type", "lens")
_FISHEYE = ("fisheye", "fish_eye", "equidistant", "kannala")
_UNREAD = ("omni", "mei", "eucm", "unified", "double_sphere", "spherical", "equirect", "panoram", "division")
# XRPrimer's name for a pinhole with OpenCV's distortion, k1 to k6.
_NO_FISHEYE = "FisheyeCameraParameter"


class Lens(NamedTuple):
    """A lens in OpenCV's convention."""

    K: np.ndarray
    dist: np.ndarray
    fisheye: bool


def has_lens(camera: dict[str, Any]) -> bool:
    """Whether an object has a matrix K, or its focal lengths and principal point."""
    return any(camera.get(key) is not None for key in _MATRICES) or {"fx", "fy", "cx", "cy"} <= camera.keys()


def read_lens(path: Path, name: str, camera: dict[str, Any]) -> Lens:
    """Read K as 3 x 3 numbers or fx, fy, cx, cy (px), and OpenCV's coefficients as a list, k1, k2, p1, ..., or none.

    An object with ``data`` is a matrix of OpenCV's own JSON. A fisheye lens is marked by ``fisheye``: true or by the
    name of its model; it has k1 to k4 of cv2.fisheye.
    """
    K = _matrix(path, name, camera)
    fisheye = _is_fisheye(path, name, camera)
    key = one_of(path, name, camera, _LISTS)
    if key is not None:
        return Lens(K, plain(path, name, key, camera[key]), fisheye)
    keys = ("k1", "k2", "k3", "k4") if fisheye else _COEFFICIENTS
    dist = [0.0 if camera.get(k) is None else float(given(path, name, camera, k, 1)[0]) for k in keys]
    return Lens(K, np.array(dist), fisheye)


def plain(path: Path, name: str, key: str, value: Any, *counts: int) -> np.ndarray:
    """The numbers of a list, or of a matrix written by OpenCV's FileStorage."""
    if isinstance(value, dict) and "data" in value:
        value = value["data"]
    return numbers(path, name, key, value, *counts)


def one_of(path: Path, name: str, camera: dict[str, Any], keys: tuple[str, ...]) -> str | None:
    """The one key among several synonyms that is present; None if there is none."""
    here = [key for key in keys if camera.get(key) is not None]
    if len(here) > 1:
        raise camera_fault(path, name, f"{' and '.join(here)} are both there; keep one")
    return here[0] if here else None


def _matrix(path: Path, name: str, camera: dict[str, Any]) -> np.ndarray:
    key = one_of(path, name, camera, _MATRICES)
    if key is None:
        fx, fy, cx, cy = (float(given(path, name, camera, k, 1)[0]) for k in ("fx", "fy", "cx", "cy"))
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    found = plain(path, name, key, camera[key], 9, 16)
    if len(found) == 9:
        return found.reshape(3, 3)
    found = found.reshape(4, 4)
    # A 4 x 4 matrix is a 3 x 3 one with the last row and column of the identity; PyTorch3D's differ.
    if not np.array_equal(found[3], [0, 0, 0, 1]) or found[:3, 3].any():
        raise camera_fault(path, name, f"{key} is no matrix K with a row and a column of the unit; give 3 x 3 numbers")
    return found[:3, :3]


def _is_fisheye(path: Path, name: str, camera: dict[str, Any]) -> bool:
    if any(camera.get(key) is True for key in ("fisheye", "is_fisheye", "fisheye_model")):
        return True
    if camera.get("class_name") == _NO_FISHEYE:
        return False
    for key in _MODELS:
        model = camera.get(key)
        word = model.lower().replace("-", "_") if isinstance(model, str) else ""
        if any(part in word for part in _UNREAD):
            raise camera_fault(path, name, f"{key} is {word[:40]!r}, which is not read; undistort its images first")
        if any(part in word for part in _FISHEYE):
            return True
    return False
