"""EasyMocap's pair of calibration files, `intri.yml` and `extri.yml`."""

import re
from pathlib import Path

import numpy as np

from ..._runtime.atomic_files import written_whole
from ...cameras import Cameras
from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._opencv import matrix_numbers
from ._opencv_yaml import Value, read_opencv_yaml, yaml_matrix
from ._text import numbers, rotation, to_vector

PAIR = ("intri.yml", "extri.yml")
# Largest difference between a matrix and a vector of one rotation: files hold about six digits.
_SAME_ROTATION = 1e-3
_NO_NAME = "none"


def read_easymocap(folder: Path) -> Contents:
    """Read the pair of files in a folder: metres, Z up, and an image size only if ``W_`` and ``H_`` are nonzero.

    The keys of matrices end with the camera's name, without what follows a dot and, if the name is an unquoted number,
    without leading zeros; files by Pose2Sim use the number of the camera, from 1. The distortion is ``dist_`` or
    ``D_``, and zero if missing. Old versions of OpenCV write ``none`` before each name.
    """
    intri_path, extri_path = (folder / name for name in PAIR)
    intri, extri = read_opencv_yaml(intri_path), read_opencv_yaml(extri_path)
    names = _names(intri_path, intri)
    numbered = [str(i + 1) for i in range(len(names))]
    keys = [_key(intri, name) for name in names]
    if not any(f"K_{key}" in intri for key in keys) and all(f"K_{key}" in intri for key in numbered):
        keys = numbered
    entries = [_entry(intri_path, extri_path, intri, extri, name, key) for name, key in zip(names, keys, strict=True)]
    return Contents("EasyMocap", entries, 1.0, "+Z")


def _names(path: Path, intri: dict[str, Value]) -> list[str]:
    names = intri.get("names")
    if not isinstance(names, list):
        raise fault(path, "names", "is missing or no list; give the names of the cameras")
    # EasyMocap reads an unquoted number as an integer.
    texts = [name if isinstance(name, str) else f"{name:.0f}" for name in names]
    return [name for name in texts if name != _NO_NAME]


def _key(intri: dict[str, Value], name: str) -> str:
    """Name of a camera in the keys of its matrices."""
    without_zeros = name.lstrip("0") or "0" if name.isdecimal() else name
    return next((key for key in (name, name.split(".")[0], without_zeros) if f"K_{key}" in intri), name)


def write_easymocap_calibration(folder: str | Path, cameras: Cameras) -> None:
    """Write `intri.yml` and `extri.yml` as EasyMocap reads them.

    Args:
        folder: Folder for the two files.
        cameras: The rig (m), in a world with Z up, as EasyMocap expects ([`Cameras.rotated`][] rotates a world).

    Raises:
        ValueError: A name that cannot be part of a key, or a lens that the format cannot express: one with k4, k5 or
            k6, or a fisheye.
    """
    intri = ["%YAML:1.0", "---", "names:", *(f'   - "{name}"' for name in cameras.names)]
    extri = list(intri)
    for i, name in enumerate(cameras.names):
        dist = np.asarray(cameras.dist[i])
        if not re.fullmatch(r"[\w.-]+", name):
            raise ValueError(f"camera {name!r}: EasyMocap takes names of letters, digits, '_', '.' and '-'; rename it")
        if cameras.are_fisheye[i]:
            raise ValueError(f"camera {name}: EasyMocap has no fisheye lens; undistort its images first")
        if dist[5:].any():
            raise ValueError(f"camera {name}: EasyMocap has no lens with k4, k5 and k6; undistort its images first")
        R = np.asarray(cameras.R[i])
        width, height = cameras.size[i].tolist()
        intri += yaml_matrix(f"K_{name}", np.asarray(cameras.K[i])) + yaml_matrix(f"dist_{name}", dist[None, :5])
        intri += [f"H_{name}: {height}", f"W_{name}: {width}"]
        extri += yaml_matrix(f"R_{name}", to_vector(R))
        extri += yaml_matrix(f"Rot_{name}", R) + yaml_matrix(f"T_{name}", np.asarray(cameras.t[i])[:, None])
    for file_name, lines in zip(PAIR, (intri, extri), strict=True):
        with written_whole(Path(folder) / file_name) as file:
            file.write(("\n".join(lines) + "\n").encode())


def _entry(
    intri_path: Path, extri_path: Path, intri: dict[str, Value], extri: dict[str, Value], name: str, key: str
) -> CameraEntry:
    def given(path: Path, found: dict[str, Value], prefix: str, *counts: int) -> np.ndarray:
        if prefix + key not in found:
            raise camera_fault(path, name, f"{prefix}{key} is missing; calibrate the camera, or take it out of names")
        return matrix_numbers(path, name, prefix + key, found[prefix + key], *counts)

    turns = []
    if f"R_{key}" in extri or f"Rot_{key}" not in extri:
        turns.append(rotation(extri_path, name, f"R_{key}", given(extri_path, extri, "R_", 3, 9)))
    if f"Rot_{key}" in extri:
        turns.append(given(extri_path, extri, "Rot_", 9).reshape(3, 3))
    if np.abs(turns[0] - turns[-1]).max() > _SAME_ROTATION:
        raise camera_fault(
            extri_path, name, f"R_{key} and Rot_{key} are different rotations, or Rot_{key} is not a rotation; keep one"
        )
    size = None
    if f"W_{key}" in intri and f"H_{key}" in intri:
        width, height = (float(numbers(intri_path, name, s + key, intri[s + key], 1)[0]) for s in ("W_", "H_"))
        size = (width, height) if width > 0 and height > 0 else None
    lens = next((prefix for prefix in ("dist_", "D_") if prefix + key in intri), None)
    return CameraEntry(
        name=name,
        K=given(intri_path, intri, "K_", 9).reshape(3, 3),
        R=turns[-1],
        t=given(extri_path, extri, "T_", 3),
        dist=given(intri_path, intri, lens) if lens is not None else np.zeros(0),
        size=size,
    )
