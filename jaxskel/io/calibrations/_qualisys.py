"""Qualisys Track Manager's calibration: a `.qca.txt` file (XML), or the parameters sent by its real-time protocol."""

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents
from ._qualisys_elements import PARTS, calibrated_cameras, in_pixels, intrinsics, name_of, sorted_contents, transform
from ._qualisys_resolution import recorded

PROTOCOL = "QTM_Parameters"
"""Beginning of the root element's name in what the real-time protocol sends."""
# The camera looks along -z with y up; OpenCV's looks along +z with y down.
_FROM_QUALISYS = np.diag([1.0, -1.0, -1.0])


def read_qualisys(path: Path) -> Contents:
    """Read the active cameras, named by their serial numbers; only the video cameras if some are marked as such.

    Lengths are millimetres, the world has Z up. Image coordinates are those of the recorded part of the sensor
    (``fov_video``), as recorded: ``viewrotation`` only affects display. The lens coefficients are OpenCV's and have no
    unit. (Pose2Sim, as of version 0.10, divides them by 64 too when it converts such a file.)
    """
    cameras = calibrated_cameras(path)
    if any(in_pixels(camera) for camera in cameras):
        raise fault(path, None, "counts only some sensors in pixels, as Theia3D does; export it again from QTM")
    cameras = [camera for camera in cameras if _is_video(camera)] or cameras
    return sorted_contents("Qualisys", [_entry(path, camera) for camera in cameras], "+Z")


def _is_video(camera: Element) -> bool:
    # Edited or converted files have "none". A hybrid camera that films has a video resolution.
    model = camera.get("model", "none").lower()
    if "hybrid" in model:
        return camera.get("video_resolution", "").strip().upper() != "N/A"
    return "video" in model or model == "none"


def _entry(path: Path, camera: Element) -> CameraEntry:
    K, dist = intrinsics(path, camera, PARTS)
    turn, centre = transform(path, camera)
    R = _FROM_QUALISYS @ turn
    K, size = recorded(path, camera, K)
    return CameraEntry(name_of(camera), K, R, -R @ centre, dist, size)
