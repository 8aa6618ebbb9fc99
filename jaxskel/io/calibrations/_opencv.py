"""Cameras written by OpenCV's FileStorage, one a file: what its calibration samples write, with the pose added."""

import os
from pathlib import Path

import numpy as np

from .._archive import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._folder import sorted_files, sorted_folders
from ._opencv_keys import HEIGHT, LENS, MATRIX, ROTATION, SIZE, TRANSLATION, WIDTH, keys_of, part_of
from ._opencv_xml import ROOT, read_opencv_xml
from ._opencv_yaml import Matrix, Value, read_opencv_yaml
from ._text import numbers, read_text, rotation

_YAML = (".yml", ".yaml")
_FISHEYE = 4  # coefficients


def read_opencv(path: Path) -> Contents:
    """Read a file of a camera, or a folder of them, in the order of their names, cam_2 before cam_10.

    In the folder are files, YAML or XML, side by side, or folders with one such file each, which then name the cameras.
    A file holds an intrinsic matrix, distortion coefficients and a rotation, a matrix or a vector, and a translation
    from world to camera, under the usual names (`_opencv_keys.py`), and maybe the size of the image. A camera has the
    name ``camera_name``, or that of its file or folder. No unit is stated: metres are taken.
    """
    files = camera_files(path) if os.path.isdir(path) else {path.stem: path}
    if not files:
        raise fault(path, None, "holds no camera that OpenCV wrote; give a folder with one file a camera")
    kind = "YAML" if next(iter(files.values())).suffix.lower() in _YAML else "XML"
    entries = [_entry(file, name, _found(file)) for name, file in files.items()]
    return Contents(f"OpenCV {kind}", entries, 1.0, None)


def camera_files(folder: Path) -> dict[str, Path]:
    """The files of a folder, or of the folders in it, that may hold a camera, by its name."""
    direct = _holders(folder)
    if direct:
        return {file.stem: file for file in direct}
    found = {}
    folders = sorted_folders(folder)
    for inner in folders:
        held = _holders(inner)
        if len(held) > 1:
            listed = ", ".join(file.name for file in held)
            raise fault(inner, None, f"holds several cameras, {listed}; keep one file in the folder of each camera")
        if held:
            found[inner.name] = held[0]
    names = {file.name for file in found.values()}
    for inner in folders:
        # A camera whose file is damaged would be missing without a word.
        for file in () if inner.name in found else (inner / name for name in names if os.path.isfile(inner / name)):
            raise fault(file, None, "holds no camera, as those in the folders beside it do; export it again")
    return found


def matrix_numbers(path: Path, camera: str, key: str, value: Value, *counts: int) -> np.ndarray:
    """The numbers of a matrix or a list."""
    return numbers(path, camera, key, value.data if isinstance(value, Matrix) else value, *counts)


def _holders(folder: Path) -> list[Path]:
    """Files of a folder that are YAML, or XML of a camera: boards and settings are written as XML too."""
    files = sorted_files(folder, *_YAML, ".xml")
    return [file for file in files if file.suffix.lower() in _YAML or _holds_camera(file)]


def _holds_camera(file: Path) -> bool:
    if f"<{ROOT}" not in read_text(file):
        return False
    found = read_opencv_xml(file)
    return any(keys_of(found, part) for part in (MATRIX, ROTATION, TRANSLATION))


def _found(path: Path) -> dict[str, Value]:
    return read_opencv_yaml(path) if path.suffix.lower() in _YAML else read_opencv_xml(path)


def _entry(path: Path, stem: str, found: dict[str, Value]) -> CameraEntry:
    name = found.get("camera_name", stem)
    name = name if isinstance(name, str) else stem
    is_fisheye = bool(found.get("fisheye_model")) or found.get("distortion_model") in ("equidistant", "fisheye")

    def of(*counts: int):  # noqa: ANN202
        return lambda key, value: matrix_numbers(path, name, key, value, *counts)

    def turn(key: str, value: Value) -> np.ndarray:
        return rotation(path, name, key, value.data if isinstance(value, Matrix) else value)

    dist = part_of(path, name, found, LENS, of())
    if is_fisheye and len(dist) != _FISHEYE:
        raise camera_fault(
            path, name, f"is a fisheye lens with {len(dist)} coefficients; cv2.fisheye has four: calibrate with it, or "
            "undistort the images (cv2.fisheye.undistortImage)",
        )  # fmt: skip
    return CameraEntry(
        name=name,
        K=part_of(path, name, found, MATRIX, of(9)).reshape(3, 3),
        R=part_of(path, name, found, ROTATION, turn),
        t=part_of(path, name, found, TRANSLATION, of(3)),
        dist=dist,
        size=_size(path, name, found),
        fisheye=is_fisheye,
    )


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
