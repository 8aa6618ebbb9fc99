"""Calibrations of multical, `calibration.json`."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._json import given, table_of

# Number of coefficients of fisheye cameras, their only mark: OpenCV's calibrateCamera never gives four.
_OF_FISHEYE = 4
_LONGEST_KEY = 500
_FISHEYE_MODELS = ("fisheye", "fix_k1", "fix_k2", "fix_k3", "fix_k4")


def is_multical(table: Any) -> bool:
    """Whether JSON has named cameras with multical's keys."""
    cameras = table.get("cameras") if isinstance(table, dict) else None
    return isinstance(cameras, dict) and any(
        isinstance(camera, dict) and camera.keys() >= {"K", "dist", "image_size"} for camera in cameras.values()
    )


def read_multical(path: Path, table: dict[str, Any]) -> Contents:
    """Read all cameras with a pose, in the frame of the first or of a rig, in the unit of its boards (metres).

    A pose is stored under the camera's name and maps the rig to the camera, or under ``cam2_to_cam1``, which in spite
    of the name maps the frame of cam1 to that of cam2. The up axis is unknown.
    """
    cameras = table["cameras"]
    poses = table.get("camera_poses")
    if not isinstance(poses, dict) or not poses:
        raise fault(path, "camera_poses", "is missing: it holds intrinsics only; export the calibration of the rig")
    keys = _keys(poses, cameras)
    known: dict[str, np.ndarray] = {}
    entries = [_entry(path, name, cameras, _pose(path, name, poses, keys, known)) for name in cameras if name in keys]
    unposed = tuple(name for name in cameras if name not in keys)
    return Contents("multical JSON", entries, 1.0, None, unposed=unposed)


def _entry(path: Path, name: str, cameras: dict[str, Any], pose: np.ndarray) -> CameraEntry:
    camera = table_of(path, name, "the camera", cameras[name])
    width, height = given(path, name, camera, "image_size", 2).tolist()
    dist = given(path, name, camera, "dist")
    is_fisheye = len(dist) == _OF_FISHEYE or camera.get("model") in _FISHEYE_MODELS
    if is_fisheye and camera.get("model") == "standard" and not dist.any():
        raise camera_fault(
            path, name, "has four coefficients of zero: fisheye lenses have four, but they are never zero; give five"
        )
    return CameraEntry(
        name=name,
        K=given(path, name, camera, "K", 9).reshape(3, 3),
        R=pose[:3, :3],
        t=pose[:3, 3],
        dist=dist,
        size=(width, height),
        fisheye=is_fisheye,
    )


def _keys(poses: dict[str, Any], cameras: dict[str, Any]) -> dict[str, list[tuple[str, str | None]]]:
    """For each camera, the keys of its poses, and the camera that each is relative to."""
    found: dict[str, list[tuple[str, str | None]]] = {}
    for key in poses:
        if key in cameras:
            found.setdefault(key, []).append((key, None))
        # Limit the length, since a key of nothing but separators would take hours.
        for mark in re.finditer("(?=_to_)", key[:_LONGEST_KEY]):
            name, other = key[: mark.start()], key[mark.start() + len("_to_") :]
            if name in cameras and other in cameras:
                found.setdefault(name, []).append((key, other))
    return found


def _pose(
    path: Path,
    name: str,
    poses: dict[str, Any],
    keys: dict[str, list[tuple[str, str | None]]],
    known: dict[str, np.ndarray],
) -> np.ndarray:
    """Pose from the frame of the file to a camera, along a chain of relative poses.

    The camera at the end of the chain needs no pose if it is the frame itself.
    """
    chain: list[tuple[str, np.ndarray]] = []
    last: str | None = name
    while last is not None and last in keys and last not in known:
        if len(keys[last]) > 1:
            told = ", ".join(key for key, _ in keys[last])
            raise camera_fault(path, last, f"has the poses {told}; keep one")
        if any(last == passed for passed, _ in chain):
            raise camera_fault(path, name, f"its pose is relative to {last}, and that to it; export it again")
        key, other = keys[last][0]
        pose = table_of(path, last, f"camera_poses.{key}", poses[key])
        step = np.eye(4)
        step[:3, :3] = given(path, last, pose, "R", 9).reshape(3, 3)
        step[:3, 3] = given(path, last, pose, "T", 3)
        chain.append((last, step))
        last = other
    whole = np.eye(4) if last is None or last not in known else known[last]
    for passed, step in reversed(chain):
        whole = step @ whole
        known[passed] = whole
    return known[name]
