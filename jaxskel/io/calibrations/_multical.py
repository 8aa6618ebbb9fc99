"""multical's `calibration.json`."""

from pathlib import Path
from typing import Any

import numpy as np

from .._archive import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._json import given, table_of

# Its fisheye cameras export no other mark than their four coefficients: OpenCV's calibrateCamera never gives four.
_OF_FISHEYE = 4
_FISHEYE_MODELS = ("fisheye", "fix_k1", "fix_k2", "fix_k3", "fix_k4")


def is_multical(table: Any) -> bool:
    """Whether JSON has cameras by their names, with multical's keys."""
    cameras = table.get("cameras") if isinstance(table, dict) else None
    return isinstance(cameras, dict) and any(
        isinstance(camera, dict) and camera.keys() >= {"K", "dist", "image_size"} for camera in cameras.values()
    )


def read_multical(path: Path, table: dict[str, Any]) -> Contents:
    """Read all cameras that were posed, in the frame of the first or of a rig: metres, as its boards are measured in.

    A pose stands under the camera's name and is from the rig to the camera, or under ``cam2_to_cam1``; despite that
    name it takes points from the frame of cam1 to that of cam2. What is up in a room no file says.
    """
    cameras = table["cameras"]
    poses = table.get("camera_poses")
    if not isinstance(poses, dict) or not poses:
        raise fault(path, "camera_poses", "is missing: it holds intrinsics only; export the calibration of the rig")
    unposed = tuple(name for name in cameras if not _keys(poses, cameras, name))
    entries = [_entry(path, name, cameras, poses) for name in cameras if name not in unposed]
    return Contents("multical JSON", entries, 1.0, None, unposed=unposed)


def _entry(path: Path, name: str, cameras: dict[str, Any], poses: dict[str, Any]) -> CameraEntry:
    camera = table_of(path, name, "the camera", cameras[name])
    width, height = given(path, name, camera, "image_size", 2).tolist()
    dist = given(path, name, camera, "dist")
    is_fisheye = len(dist) == _OF_FISHEYE or camera.get("model") in _FISHEYE_MODELS
    if is_fisheye and camera.get("model") == "standard" and not dist.any():
        raise camera_fault(
            path, name, "has four coefficients of zero: fisheye lenses have four, but they are never zero; give five"
        )
    pose = _pose(path, name, cameras, poses)
    return CameraEntry(
        name=name,
        K=given(path, name, camera, "K", 9).reshape(3, 3),
        R=pose[:3, :3],
        t=pose[:3, 3],
        dist=dist,
        size=(width, height),
        fisheye=is_fisheye,
    )


def _keys(poses: dict[str, Any], cameras: dict[str, Any], name: str) -> list[tuple[str, str | None]]:
    """Under which keys a camera has a pose, and relative to which camera."""
    start = f"{name}_to_"
    found: list[tuple[str, str | None]] = [(name, None)] if name in poses else []
    found += [(key, key[len(start) :]) for key in poses if key.startswith(start) and key[len(start) :] in cameras]
    return found


def _pose(path: Path, name: str, cameras: dict[str, Any], poses: dict[str, Any]) -> np.ndarray:
    """From the frame of the file to the camera, along a chain of cameras that each stand relative to another."""
    whole, passed = np.eye(4), [name]
    while True:
        keys = _keys(poses, cameras, passed[-1])
        if len(keys) != 1:
            told = f"poses {', '.join(key for key, _ in keys)}: keep one" if keys else "no pose"
            raise camera_fault(path, name, f"{passed[-1]} has {told}")
        key, other = keys[0]
        pose = table_of(path, name, f"camera_poses.{key}", poses[key])
        step = np.eye(4)
        step[:3, :3] = given(path, name, pose, "R", 9).reshape(3, 3)
        step[:3, 3] = given(path, name, pose, "T", 3)
        whole = whole @ step
        if other is None:
            return whole
        if other in passed:
            raise camera_fault(path, name, f"its pose is relative to {other}, and that to it; export it again")
        # The camera that the others are relative to may be left out where it is the frame itself.
        if not _keys(poses, cameras, other):
            return whole
        passed.append(other)
