"""Open3D's cameras in JSON: a trajectory, or one file for each camera."""

from pathlib import Path
from typing import Any

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._json import given, table_of

TRAJECTORY, CAMERA = "PinholeCameraTrajectory", "PinholeCameraParameters"


def is_open3d(table: Any) -> bool:
    """Whether JSON declares to be one or several cameras of Open3D."""
    return isinstance(table, dict) and table.get("class_name") in (TRAJECTORY, CAMERA)


def read_open3d(path: Path, table: dict[str, Any]) -> Contents:
    """Read a trajectory, cam0, cam1, ...; or one camera, named after its file.

    Matrices are stored by columns; ``extrinsic`` maps world to camera; integer coordinates are pixel centres. Lenses
    have no distortion. The unit is not stated; metres are assumed. Open3D's first versions have one ``intrinsic`` for
    all.
    """
    if table["class_name"] == CAMERA:
        return Contents("Open3D JSON", [_entry(path, path.stem, table)], 1.0, None)
    if "parameters" in table:
        cameras = table["parameters"]
    elif isinstance(table.get("extrinsic"), list):
        cameras = [{"extrinsic": each, "intrinsic": table.get("intrinsic")} for each in table["extrinsic"]]
    else:
        cameras = None
    if not isinstance(cameras, list):
        raise fault(path, "parameters", "is missing or no list; write the trajectory again")
    entries = [_entry(path, f"cam{i}", table_of(path, f"cam{i}", "the camera", each)) for i, each in enumerate(cameras)]
    return Contents("Open3D JSON", entries, 1.0, None)


def _entry(path: Path, name: str, camera: dict[str, Any]) -> CameraEntry:
    lens = table_of(path, name, "intrinsic", camera.get("intrinsic"))
    pose = given(path, name, camera, "extrinsic", 16).reshape(4, 4).T
    K = given(path, name, lens, "intrinsic_matrix", 9).reshape(3, 3).T
    for key, last, wanted in (("extrinsic", pose[3], [0, 0, 0, 1]), ("intrinsic_matrix", K[2], [0, 0, 1])):
        if not np.array_equal(last, wanted):
            raise camera_fault(
                path, name, f"{key} does not end in the row {wanted}; give it column by column, as Open3D writes it"
            )
    width, height = (float(given(path, name, lens, key, 1)[0]) for key in ("width", "height"))
    return CameraEntry(name, K, pose[:3, :3], pose[:3, 3], np.zeros(0), (width, height))
