"""`transforms.json` of nerfstudio and instant-ngp: one camera for each image."""

from pathlib import Path
from typing import Any

import numpy as np

from ._calibration import CameraEntry, Contents, camera_fault
from ._image_files import names_of_images
from ._json import check_count, given

_PINHOLES = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL")
# As in COLMAP, the origin of image coordinates is the corner of the first pixel; OpenCV's is its centre.
_HALF_PIXEL = 0.5
# The camera looks along -z with y up; OpenCV's looks along +z with y down.
_FROM_OPENGL = np.diag([1.0, -1.0, -1.0])


def is_nerf(table: Any) -> bool:
    """Whether JSON lists images with camera poses."""
    frames = table.get("frames") if isinstance(table, dict) else None
    return isinstance(frames, list) and any(isinstance(f, dict) and "transform_matrix" in f for f in frames)


def read_nerf(path: Path, table: dict[str, Any]) -> Contents:
    """Read a camera for each image, named after it (cam1.png or cam1/0001.png).

    ``transform_matrix`` maps camera to world, in OpenGL's axes. Intrinsics are at the top level or with the image:
    ``fl_x``, ``fl_y``, ``cx``, ``cy``, ``w``, ``h`` (px), or the field of view ``camera_angle_x`` (rad) and the size.
    The file states neither a scale nor an up axis.
    """
    frames = table["frames"]
    check_count(path, len(frames))
    files = []
    for i, frame in enumerate(frames):
        file = frame.get("file_path") if isinstance(frame, dict) else None
        if not isinstance(file, str):
            raise camera_fault(path, f"number {i}", "file_path is missing or no text")
        files.append(file)
    names = names_of_images(path, files)
    entries = [_entry(path, name, {**table, **frame}) for name, frame in zip(names, frames, strict=True)]
    return Contents("nerfstudio JSON", entries, None, None)


def _entry(path: Path, name: str, camera: dict[str, Any]) -> CameraEntry:
    def value(key: str, default: float | None = None) -> float:
        return default if default is not None and key not in camera else float(given(path, name, camera, key, 1)[0])

    model = camera.get("camera_model", "OPENCV")
    is_fisheye = model == "OPENCV_FISHEYE" or camera.get("is_fisheye") is True
    if not is_fisheye and model not in _PINHOLES:
        raise camera_fault(
            path, name, f"has the camera_model {str(model)[:40]}, which is not read; use {', '.join(_PINHOLES)}"
        )
    width, height = value("w"), value("h")
    if "fl_x" in camera or "camera_angle_x" not in camera:
        fx = value("fl_x")
    else:
        angle = value("camera_angle_x")
        if not 0 < angle < np.pi:
            raise camera_fault(path, name, f"camera_angle_x is {angle:g}; give the opening in radians")
        fx = width / 2 / np.tan(angle / 2)
    fy = value("fl_y", fx)
    u, v = value("cx", width / 2) - _HALF_PIXEL, value("cy", height / 2) - _HALF_PIXEL
    if is_fisheye:
        dist = [value(key, 0.0) for key in ("k1", "k2", "k3", "k4")]
    else:
        dist = [value(key, 0.0) for key in ("k1", "k2", "p1", "p2", "k3")]
        if value("k4", 0.0):
            raise camera_fault(
                path, name, "k4 is not OpenCV's: nerfstudio has it for r^8, which is not read; undistort its images"
            )
    pose = given(path, name, camera, "transform_matrix", 12, 16)
    if len(pose) == 16 and not np.array_equal(pose[12:], [0, 0, 0, 1]):
        raise camera_fault(path, name, "transform_matrix does not end in the row [0, 0, 0, 1]; give it row by row")
    pose = pose[:12].reshape(3, 4)
    R = _FROM_OPENGL @ pose[:, :3].T
    return CameraEntry(
        name=name,
        K=np.array([[fx, 0.0, u], [0.0, fy, v], [0.0, 0.0, 1.0]]),
        R=R,
        t=-R @ pose[:, 3],
        dist=np.array(dist),
        size=(width, height),
        fisheye=is_fisheye,
    )
