"""Calibrations of the CMU Panoptic Studio, JSON."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from .._archive import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._text import numbers, read_text

_CENTIMETRE = 0.01


def read_panoptic(path: Path) -> Contents:
    """Read all cameras (VGA, HD and Kinect), in centimetres and in a world whose Y axis points down."""
    try:
        table = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise fault(path, None, f"is not JSON ({error}); download the calibration again") from None
    cameras = table.get("cameras") if isinstance(table, dict) else None
    if not isinstance(cameras, list):
        raise fault(path, "cameras", "is missing or no list; give a calibration of the Panoptic Studio")
    return Contents("CMU Panoptic JSON", [_entry(path, i, c) for i, c in enumerate(cameras)], _CENTIMETRE, "-Y")


def _entry(path: Path, index: int, camera: Any) -> CameraEntry:
    name = camera.get("name") if isinstance(camera, dict) else None
    if not isinstance(name, str):
        raise camera_fault(path, f"number {index}", "name is missing or no text")

    def given(key: str, *counts: int) -> np.ndarray:
        if key not in camera:
            raise camera_fault(path, name, f"{key} is missing; download the calibration again")
        return numbers(path, name, key, camera[key], *counts)

    width, height = given("resolution", 2).tolist()
    K, R = given("K", 9).reshape(3, 3), given("R", 9).reshape(3, 3)
    return CameraEntry(name, K, R, given("t", 3), given("distCoef"), (width, height))
