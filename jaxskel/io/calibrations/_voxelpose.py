"""Calibrations of the Campus and Shelf data sets, in the JSON of VoxelPose and MMPose."""

from pathlib import Path
from typing import Any

import numpy as np

from ._calibration import CameraEntry, Contents
from ._json import given, table_of
from ._text import natural_order

_KEYS = {"R", "T", "fx", "fy", "cx", "cy", "k", "p"}
_MILLIMETRE = 0.001


def is_voxelpose(table: Any) -> bool:
    """Whether JSON is an object of cameras with VoxelPose's eight keys."""
    return (
        isinstance(table, dict)
        and len(table) > 0
        and any(isinstance(camera, dict) and camera.keys() >= _KEYS for camera in table.values())
    )


def read_voxelpose(path: Path, table: dict[str, Any]) -> Contents:
    """Read all cameras, named by their numbers: millimetres, a world with Z up, no image sizes.

    ``T`` is the optical centre, not a translation: ``x_cam = R (x - T)``, as in VoxelPose's `project_point_radial`.
    ``k`` holds OpenCV's k1, k2, k3, and ``p`` its p1, p2.
    """
    return Contents(
        "VoxelPose JSON",
        [_entry(path, name, table[name]) for name in sorted(table, key=natural_order)],
        _MILLIMETRE,
        "+Z",
    )


def _entry(path: Path, name: str, camera: Any) -> CameraEntry:
    camera = table_of(path, name, "the camera", camera)
    fx, fy, cx, cy = (float(given(path, name, camera, key, 1)[0]) for key in ("fx", "fy", "cx", "cy"))
    R = given(path, name, camera, "R", 9).reshape(3, 3)
    k1, k2, k3 = given(path, name, camera, "k", 3)
    p1, p2 = given(path, name, camera, "p", 2)
    return CameraEntry(
        name=name,
        K=np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
        R=R,
        t=-R @ given(path, name, camera, "T", 3),
        dist=np.array([k1, k2, p1, p2, k3]),
        size=None,
    )
