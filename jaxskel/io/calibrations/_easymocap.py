"""EasyMocap's pair of files, `intri.yml` and `extri.yml`."""

import re
from pathlib import Path

import numpy as np

from ..._camera import Cameras
from ..._files import written_whole
from .._archive import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._opencv import matrix_numbers
from ._opencv_yaml import Value, read_opencv_yaml, yaml_matrix
from ._text import from_vector, numbers, to_vector

PAIR = ("intri.yml", "extri.yml")
# Files hold about six digits; a matrix and a vector of one rotation differ by less than this.
_SAME_ROTATION = 1e-3


def read_easymocap(folder: Path) -> Contents:
    """Read the pair of files in a folder: metres, a world with Z up, and no image size but where ``W_`` and ``H_`` are.

    Pose2Sim names a file's matrices by the number of the camera, from 1, and not by its name: that is read too.
    """
    intri_path, extri_path = (folder / name for name in PAIR)
    intri, extri = read_opencv_yaml(intri_path), read_opencv_yaml(extri_path)
    names = intri.get("names")
    if not isinstance(names, list):
        raise fault(intri_path, "names", "is missing or no list; give the names of the cameras")
    texts = [name for name in names if isinstance(name, str)]
    if len(texts) < len(names):
        raise fault(intri_path, "names", "holds numbers; put the names of the cameras in quotes")
    numbered = [str(i + 1) for i in range(len(texts))]
    by_name = any(f"K_{name}" in intri for name in texts)
    keys = texts if by_name or not all(f"K_{key}" in intri for key in numbered) else numbered
    entries = [_entry(intri_path, extri_path, intri, extri, name, key) for name, key in zip(texts, keys, strict=True)]
    return Contents("EasyMocap", entries, 1.0, "+Z")


def write_easymocap_calibration(folder: str | Path, cameras: Cameras) -> None:
    """Write `intri.yml` and `extri.yml` as EasyMocap reads them.

    Args:
        folder: Where to write the two files.
        cameras: The rig, in a world with Z up, as EasyMocap takes it to be ([`Cameras.rotated`][] turns a world).

    Raises:
        ValueError: A name that cannot be part of a key, or a lens that the format cannot hold: one with k4, k5 or k6,
            or a fisheye.
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
        turns.append(from_vector(extri_path, name, f"R_{key}", given(extri_path, extri, "R_", 3)))
    if f"Rot_{key}" in extri:
        turns.append(given(extri_path, extri, "Rot_", 9).reshape(3, 3))
    if np.abs(turns[0] - turns[-1]).max() > _SAME_ROTATION:
        raise camera_fault(
            extri_path, name, f"R_{key} and Rot_{key} are different rotations, or Rot_{key} is not a rotation; keep one"
        )
    size = None
    if f"W_{key}" in intri and f"H_{key}" in intri:
        width, height = (float(numbers(intri_path, name, s + key, intri[s + key], 1)[0]) for s in ("W_", "H_"))
        size = (width, height)
    return CameraEntry(
        name=name,
        K=given(intri_path, intri, "K_", 9).reshape(3, 3),
        R=turns[-1],
        t=given(extri_path, extri, "T_", 3),
        dist=given(intri_path, intri, "dist_", 0, 4, 5, 8),
        size=size,
    )
