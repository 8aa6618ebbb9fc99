"""Calibrations of the CMU Panoptic Studio, JSON."""

from pathlib import Path
from typing import Any

from ._calibration import CameraEntry, Contents, camera_fault
from ._json import given

_CENTIMETRE = 0.01


def is_panoptic(table: Any) -> bool:
    """Whether JSON lists cameras with the Panoptic Studio's keys for lens and image size."""
    cameras = table.get("cameras") if isinstance(table, dict) else None
    if not isinstance(cameras, list):
        return False
    return "calibDataSource" in table or any(
        isinstance(camera, dict) and camera.keys() >= {"distCoef", "resolution"} for camera in cameras
    )


def read_panoptic(path: Path, table: dict[str, Any]) -> Contents:
    """Read all cameras (VGA, HD and Kinect), in centimetres and in a world whose Y axis points down."""
    entries = [_entry(path, i, camera) for i, camera in enumerate(table["cameras"])]
    return Contents("CMU Panoptic JSON", entries, _CENTIMETRE, "-Y")


def _entry(path: Path, index: int, camera: Any) -> CameraEntry:
    name = camera.get("name") if isinstance(camera, dict) else None
    if not isinstance(name, str):
        raise camera_fault(path, f"number {index}", "name is missing or no text")
    width, height = given(path, name, camera, "resolution", 2).tolist()
    return CameraEntry(
        name=name,
        K=given(path, name, camera, "K", 9).reshape(3, 3),
        R=given(path, name, camera, "R", 9).reshape(3, 3),
        t=given(path, name, camera, "t", 3),
        dist=given(path, name, camera, "distCoef"),
        size=(width, height),
    )
