"""Skeletool's calibration, used by MPI-INF-3DHP and DynaCap: text with a block of named lines for each camera."""

from pathlib import Path

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._text import read_text, split_numbers

HEADER = "Skeletool Camera Calibration File"
_MILLIMETRE = 0.001
# Keys of a fisheye lens, a polynomial of the angle whose definition is not published.
_FISHEYE = ("polynomial", "polynomialC2W", "polynomialW2C", "affine", "imageCircleRadius")
_MAX_BYTES = 2_000_000  # bytes; a camera takes 0.5 kB


def read_skeletool(path: Path) -> Contents:
    """Read the cameras of a file of version 1.0: 4 x 4 matrices by rows, from world to camera in millimetres.

    The camera looks along +z with y down. The format does not state the up axis.
    """
    first, *lines = read_text(path, _MAX_BYTES).splitlines() or [""]
    if first.split() != [*HEADER.split(), "V1.0"]:
        raise fault(path, None, f"begins with {first[:80]!r}; only version V1.0 of Skeletool's files is read")
    cameras: list[dict[str, str]] = []
    for line in lines:
        key, _, rest = " ".join(line.split(maxsplit=1)).partition(" ")
        if not key:
            continue
        if key == "name":
            if not rest:
                raise fault(path, None, "has a camera without a name; export it again")
            cameras.append({})
        elif not cameras:
            raise fault(path, None, f"has {key[:40]!r} before the first name; export it again")
        elif key in cameras[-1] and key != "frame":
            raise camera_fault(path, cameras[-1]["name"], f"{key[:40]} is there twice; the camera must not move")
        cameras[-1][key] = rest.strip()
    return Contents("Skeletool", [_entry(path, camera) for camera in cameras], _MILLIMETRE, None)


def _entry(path: Path, camera: dict[str, str]) -> CameraEntry:
    name = camera["name"]

    def given(key: str, *counts: int) -> np.ndarray:
        if key not in camera:
            raise camera_fault(path, name, f"{key} is missing; export it again")
        return split_numbers(path, name, key, camera[key], *counts)

    if any(key in camera for key in _FISHEYE):
        raise camera_fault(path, name, "is a fisheye lens of Skeletool's own model; undistort its images first")
    if "frame" in camera or given("animated", 1).any():
        raise camera_fault(path, name, "moves (animated); only cameras that stand still are read")
    if given("radial").any():
        raise camera_fault(path, name, "radial is not 0: that model is not published; undistort its images first")
    width, height = given("size", 2).tolist()
    K, pose = (given(key, 16).reshape(4, 4) for key in ("intrinsic", "extrinsic"))
    if not np.allclose(pose[3], [0, 0, 0, 1]):
        raise camera_fault(path, name, "extrinsic is no rigid motion: its last row is not 0 0 0 1")
    return CameraEntry(name, K[:3, :3], pose[:3, :3], pose[:3, 3], np.zeros(0), (width, height))
