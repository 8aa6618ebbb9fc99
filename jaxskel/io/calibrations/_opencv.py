"""Cameras written by OpenCV's FileStorage, one for each file: the format of its calibration samples, plus a pose."""

import os
from pathlib import Path

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._folder import sorted_files, sorted_folders
from ._opencv_json import MARK, read_opencv_json
from ._opencv_keys import HEIGHT, LENS, MATRIX, ROTATION, SIZE, TRANSLATION, WIDTH, keys_of, part_of
from ._opencv_xml import ROOT, read_opencv_xml
from ._opencv_yaml import Matrix, Value, read_opencv_yaml
from ._text import numbers, read_text, rotation

_YAML = (".yml", ".yaml")
# Text that marks files of the other syntaxes as written by OpenCV.
_MARKS = {".xml": f"<{ROOT}", ".json": MARK}
_PARTS = (MATRIX, ROTATION, TRANSLATION)
# Names of the lens model of cv2.fisheye, the first in ROS; OpenCV's own sample writes `fisheye_model: 1` instead.
_FISHEYE_MODELS = ("equidistant", "fisheye")


def read_opencv(path: Path) -> Contents:
    """Read a file of a camera, or a folder of them, sorted by name, cam_2 before cam_10.

    The folder holds files (YAML, XML or JSON), or a folder named after each camera with one file, or with several files
    for its parts. A file holds an intrinsic matrix, distortion coefficients, and a rotation (matrix or vector) and a
    translation from world to camera, under the usual names (`_opencv_keys.py`), and optionally the image size. A camera
    is named by ``camera_name``, or after its file or folder. The unit is not stated; metres are assumed.
    """
    files = camera_files(path) if os.path.isdir(path) else {path.stem: [path]}
    if not files:
        raise fault(path, None, "holds no camera that OpenCV wrote; give a folder with one file a camera")
    kind = {".xml": "XML", ".json": "JSON"}.get(next(iter(files.values()))[0].suffix.lower(), "YAML")
    entries = [
        _entry(held[0] if len(held) == 1 else held[0].parent, name, _of_all(held)) for name, held in files.items()
    ]
    return Contents(f"OpenCV {kind}", entries, 1.0, None)


def camera_files(folder: Path) -> dict[str, list[Path]]:
    """The files of a folder, or of its subfolders, that may hold a camera, by the camera's name."""
    direct = _holders(folder)
    if direct:
        return {file.stem: [file] for file in direct}
    folders = sorted_folders(folder)
    found = {inner.name: held for inner in folders if (held := _holders(inner))}
    names = {file.name for held in found.values() for file in held}
    for inner in folders:
        # Without this error, a camera with a damaged file would be missing silently.
        for file in () if inner.name in found else (inner / name for name in names if os.path.isfile(inner / name)):
            raise fault(file, None, "holds no camera, as those in the folders beside it do; export it again")
    return found


def matrix_numbers(path: Path, camera: str, key: str, value: Value, *counts: int) -> np.ndarray:
    """The numbers of a matrix or a list."""
    return numbers(path, camera, key, value.data if isinstance(value, Matrix) else value, *counts)


def holds_camera(file: Path) -> bool:
    """Whether XML or JSON is OpenCV's and describes a camera, rather than a board or settings."""
    if _MARKS[file.suffix.lower()] not in read_text(file):
        return False
    found = _found(file)
    return any(keys_of(found, part) for part in _PARTS)


def _holders(folder: Path) -> list[Path]:
    """The YAML files of a folder, and the other files that hold a camera."""
    files = sorted_files(folder, *_YAML, *_MARKS)
    return [file for file in files if file.suffix.lower() in _YAML or holds_camera(file)]


def _found(path: Path) -> dict[str, Value]:
    return {".xml": read_opencv_xml, ".json": read_opencv_json}.get(path.suffix.lower(), read_opencv_yaml)(path)


def _of_all(files: list[Path]) -> dict[str, Value]:
    """The combined content of the files of one camera: the matrix may be in one, the pose in another."""
    whole: dict[str, Value] = {}
    for file in files:
        found = _found(file)
        for part in _PARTS:
            if keys_of(whole, part) and keys_of(found, part):
                listed = ", ".join(file.name for file in files)
                raise fault(
                    file.parent, None, f"holds {keys_of(found, part)[0]} in several of {listed}; keep one of them"
                )
        whole = found | whole
    return whole


def _entry(path: Path, stem: str, found: dict[str, Value]) -> CameraEntry:
    name = found.get("camera_name", stem)
    name = name if isinstance(name, str) else stem

    def of(*counts: int):  # noqa: ANN202
        return lambda key, value: matrix_numbers(path, name, key, value, *counts)

    def turn(key: str, value: Value) -> np.ndarray:
        return rotation(path, name, key, value.data if isinstance(value, Matrix) else value)

    return CameraEntry(
        name=name,
        K=part_of(path, name, found, MATRIX, of(9)).reshape(3, 3),
        R=part_of(path, name, found, ROTATION, turn),
        t=part_of(path, name, found, TRANSLATION, of(3)),
        dist=part_of(path, name, found, LENS, of()),
        size=_size(path, name, found),
        fisheye=_is_fisheye(path, name, found),
    )


def _is_fisheye(path: Path, name: str, found: dict[str, Value]) -> bool:
    switch = found.get("fisheye_model", 0.0)
    if switch not in (0.0, 1.0, "true", "false"):
        raise camera_fault(path, name, f"fisheye_model is {str(switch)[:40]!r}; give 1 for a fisheye lens, 0 otherwise")
    return switch in (1.0, "true") or found.get("distortion_model") in _FISHEYE_MODELS


def _size(path: Path, name: str, found: dict[str, Value]) -> tuple[float, float] | None:
    def of(count: int):  # noqa: ANN202
        return lambda key, value: matrix_numbers(path, name, key, value, count)

    there = [part for part in (WIDTH, HEIGHT) if keys_of(found, part)]
    if len(there) == 1:
        raise camera_fault(path, name, f"{keys_of(found, there[0])[0]} stands alone; give image_width and image_height")
    if there:
        width, height = (float(part_of(path, name, found, part, of(1))[0]) for part in there)
    elif keys_of(found, SIZE):
        width, height = part_of(path, name, found, SIZE, of(2)).tolist()
    else:
        return None
    return width, height
