"""OpenCV's YAML, one camera a file: what its calibration samples write, with the pose of the camera added."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from .._archive import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._opencv_yaml import Matrix, Value, read_opencv_yaml
from ._text import natural_order, numbers, rotation

# A folder holds one file a camera.
_MOST_FILES = 1000
_ROTATIONS = ("R", "rotation_matrix", "rotation", "rvec")
# Names of the lens model of cv2.fisheye, the first in ROS; OpenCV's own sample writes `fisheye_model: 1` instead.
_FISHEYE_MODELS = ("equidistant", "fisheye")
_TRANSLATIONS = ("T", "t", "translation_vector", "translation", "tvec")


def read_opencv(path: Path) -> Contents:
    """Read a file, or all `.yml` and `.yaml` files of a folder in the order of their names, cam_2 before cam_10.

    Keys: ``camera_matrix``, ``distortion_coefficients``, ``image_width`` and ``image_height``; a rotation from world
    to camera, a matrix or a vector, ``R``, ``rotation_matrix``, ``rotation`` or ``rvec``; a translation ``T``, ``t``,
    ``translation_vector``, ``translation`` or ``tvec``. A camera has the name ``camera_name``, or that of its file.
    No unit is stated: metres are taken.
    """
    files = [path]
    if os.path.isdir(path):
        files = sorted(
            (file for file in path.iterdir() if file.suffix.lower() in (".yml", ".yaml")),
            key=lambda file: natural_order(file.name),
        )
        if len(files) > _MOST_FILES:
            raise fault(path, None, f"holds {len(files)} YAML files; give a folder with one file a camera")
    return Contents("OpenCV YAML", [_entry(file, read_opencv_yaml(file)) for file in files], 1.0, None)


def matrix_numbers(path: Path, camera: str, key: str, value: Value, *counts: int) -> np.ndarray:
    """The numbers of a matrix or a list."""
    return numbers(path, camera, key, value.data if isinstance(value, Matrix) else value, *counts)


def _entry(path: Path, found: dict[str, Value]) -> CameraEntry:
    name = found.get("camera_name", path.stem)
    name = name if isinstance(name, str) else path.stem

    def one_of(*keys: str) -> tuple[str, Any]:
        here = [key for key in keys if key in found]
        if len(here) != 1:
            raise camera_fault(
                path,
                name,
                f"{' and '.join(here)} are both there; keep one"
                if here
                else f"{' or '.join(keys)} is missing; add it (the pose of the camera in the world is needed too)",
            )
        return here[0], found[here[0]]

    def given(*keys: str, counts: tuple[int, ...]) -> np.ndarray:
        key, value = one_of(*keys)
        return matrix_numbers(path, name, key, value, *counts)

    key, turn = one_of(*_ROTATIONS)
    sides = [side for side in ("image_width", "image_height") if side in found]
    width_height = [float(matrix_numbers(path, name, side, found[side], 1)[0]) for side in sides]
    if len(sides) == 1:
        raise camera_fault(path, name, f"{sides[0]} stands alone; give image_width and image_height")
    return CameraEntry(
        name=name,
        K=given("camera_matrix", counts=(9,)).reshape(3, 3),
        R=rotation(path, name, key, turn.data if isinstance(turn, Matrix) else turn),
        t=given(*_TRANSLATIONS, counts=(3,)),
        dist=given("distortion_coefficients", counts=()),
        size=(width_height[0], width_height[1]) if sides else None,
        fisheye=_is_fisheye(path, name, found),
    )


def _is_fisheye(path: Path, name: str, found: dict[str, Value]) -> bool:
    switch = found.get("fisheye_model", 0.0)
    if switch not in (0.0, 1.0, "true", "false"):
        raise camera_fault(path, name, f"fisheye_model is {str(switch)[:40]!r}; give 1 for a fisheye lens, 0 otherwise")
    return switch in (1.0, "true") or found.get("distortion_model") in _FISHEYE_MODELS
