"""TOML of Pose2Sim, Anipose, FreeMoCap and Caliscope: one table a camera."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..._camera import Cameras
from ..._files import written_whole
from .._ours import TOML_LINE
from .._toml import parse_toml
from ._calibration import CameraEntry, Contents, camera_fault
from ._text import natural_order, numbers, read_text, rotation, to_vector

_KEYS = ("size", "matrix", "distortions", "rotation", "translation")
_MILLIMETRE = 0.001
# A camera takes 1 kB.
_MAX_BYTES = 2_000_000


def read_toml(path: Path) -> Contents:
    """Read the tables that hold a camera.

    Pose2Sim writes metres and a world with Z up; it alone gives four distortions, or names its file ``Calib...``.
    FreeMoCap writes down how long a square of its board is, in the unit of the file: more than one is millimetres.
    Anipose and Caliscope do not state a unit: metres are taken. Cameras come in the order of their tables' names,
    cam_2 before cam_10, and those that Caliscope ignores are left out. Its ``rotation_count`` says how an image is
    shown; the calibration is that of the image as recorded.
    """
    table = parse_toml(path, read_text(path, _MAX_BYTES), "export the calibration again")
    nested = table.get("cameras")
    is_caliscope = isinstance(nested, dict)
    found = {
        key: value
        for key, value in (nested if is_caliscope else table).items()
        if isinstance(value, dict) and not value.keys().isdisjoint(_KEYS) and value.get("ignore") is not True
    }
    entries = [
        _entry(path, f"cam_{key}" if is_caliscope else key, found[key]) for key in sorted(found, key=natural_order)
    ]
    metadata = table.get("metadata")
    metadata = metadata if isinstance(metadata, dict) else {}
    if is_caliscope:
        return Contents("Caliscope TOML", entries, 1.0, None)
    if "charuco_square_size" in metadata:
        square = numbers(path, "metadata", "charuco_square_size", metadata["charuco_square_size"], 1)[0]
        up = "+Z" if metadata.get("groundplane_calibration") is True else None
        return Contents("FreeMoCap TOML", entries, _MILLIMETRE if square > 1 else 1.0, up)
    if path.name.startswith("Calib") or (entries and all(len(entry.dist) == 4 for entry in entries)):
        return Contents("Pose2Sim TOML", entries, 1.0, "+Z")
    return Contents("Anipose TOML", entries, 1.0, None)


def write_pose2sim_calibration(path: str | Path, cameras: Cameras) -> None:
    """Write a calibration as Pose2Sim reads it, which Anipose's and Caliscope's readers take too.

    Args:
        path: File to write; Pose2Sim looks for ``Calib*.toml``.
        cameras: The rig, in a world with Z up, as Pose2Sim takes it to be ([`Cameras.rotated`][] turns a world).
    """
    lines = [TOML_LINE]
    for i, name in enumerate(cameras.names):
        dist = np.asarray(cameras.dist[i])
        # As few as hold the lens: Pose2Sim writes four, and OpenCV takes five or eight in their place.
        count = 8 if dist[5:].any() else 5 if dist[4] else 4
        # TOML takes a JSON string, but for the one control character that JSON leaves as it is.
        quoted = json.dumps(name, ensure_ascii=True).replace("\x7f", "\\u007f")
        lines += [
            f"[{quoted}]",
            f"name = {quoted}",
            f"size = {[float(n) for n in cameras.size[i]]}",
            f"matrix = {np.asarray(cameras.K[i]).tolist()}",
            f"distortions = {dist[:count].tolist()}",
            f"rotation = {to_vector(np.asarray(cameras.R[i])).ravel().tolist()}",
            f"translation = {np.asarray(cameras.t[i]).tolist()}",
            "fisheye = false",
            "",
        ]
    lines += ["[metadata]", "adjusted = false", "error = 0.0"]
    with written_whole(Path(path)) as file:
        file.write(("\n".join(lines) + "\n").encode())


def _entry(path: Path, key: str, table: dict[str, Any]) -> CameraEntry:
    name = table.get("name", key)
    if not isinstance(name, str):
        raise camera_fault(path, key, "name is not text")
    if table.get("fisheye"):
        raise camera_fault(
            path,
            name,
            "is a fisheye lens, which is not read; undistort its images (cv2.fisheye.undistortImage), then give the "
            "new matrix, distortions of zero and fisheye = false",
        )
    for missing in _KEYS:
        if missing not in table:
            raise camera_fault(path, name, f"{missing} is missing; calibrate the camera, or take its table out")
    width, height = numbers(path, name, "size", table["size"], 2).tolist()
    return CameraEntry(
        name=name,
        K=numbers(path, name, "matrix", table["matrix"], 9).reshape(3, 3),
        R=rotation(path, name, "rotation", table["rotation"]),
        t=numbers(path, name, "translation", table["translation"], 3),
        dist=numbers(path, name, "distortions", table["distortions"]),
        size=(width, height),
    )
