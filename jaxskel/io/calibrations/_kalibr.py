"""Kalibr's `camchain.yaml`: a chain of cameras, each posed relative to the previous one."""

import re
from pathlib import Path

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._opencv_yaml import words_of, yaml_blocks
from ._text import natural_order, numbers, read_text

_CAMERA = re.compile(r"^(cam\d{1,6}):[ \t]*$", re.MULTILINE)
_KEY = re.compile(r"^([A-Za-z]\w*):(?:\s+|$)(.*)")


def is_kalibr(path: Path) -> bool:
    """Whether a YAML file has a camera block as Kalibr writes it."""
    text = read_text(path)
    return _CAMERA.search(text) is not None and re.search(r"^\s+intrinsics:", text, re.MULTILINE) is not None


def read_kalibr(path: Path) -> Contents:
    """Read the cameras cam0, cam1, ..., in metres and in the frame of cam0; the up axis is unknown.

    ``T_cn_cnm1`` maps the frame of the previous camera to that of the camera.
    """
    blocks = yaml_blocks(path)
    names = sorted((key for key in blocks if _CAMERA.match(f"{key}:")), key=natural_order)
    if not names:
        raise fault(path, None, "holds no camera of Kalibr; give the camchain.yaml file")
    entries, pose = [], np.eye(4)
    for name in names:
        camera = _keys(blocks[name])
        if entries:
            step = _numbers(path, name, camera, "T_cn_cnm1", 16).reshape(4, 4)
            if not np.allclose(step[3], [0, 0, 0, 1]):
                raise camera_fault(path, name, "T_cn_cnm1 is no rigid motion: its last row is not 0 0 0 1")
            pose = step @ pose
        entries.append(_entry(path, name, camera, pose))
    return Contents("Kalibr", entries, 1.0, None)


def _keys(lines: list[str]) -> dict[str, str]:
    """The text behind each name of a block; lists may continue on the lines below."""
    found: dict[str, str] = {}
    key = ""
    for line in lines:
        named = _KEY.match(line)
        if named is not None:
            key, line = named[1], named[2]
        found[key] = f"{found.get(key, '')} {line.removeprefix('- ')}"
    return {key: text.strip() for key, text in found.items()}


def _numbers(path: Path, name: str, camera: dict[str, str], key: str, *counts: int) -> np.ndarray:
    if key not in camera:
        raise camera_fault(path, name, f"{key} is missing; give the camchain.yaml file as Kalibr wrote it")
    return numbers(path, name, key, words_of(path, key, camera[key], r"[^,\s\[\]]+"), *counts)


def _entry(path: Path, name: str, camera: dict[str, str], pose: np.ndarray) -> CameraEntry:
    model, lens = (camera.get(key, "none").strip("\"'") for key in ("camera_model", "distortion_model"))
    if model != "pinhole" or lens not in ("radtan", "equidistant", "none"):
        raise camera_fault(
            path,
            name,
            f"is of the model {model[:40]} with {lens[:40]}; only pinhole with radtan or equidistant is read",
        )
    fx, fy, cx, cy = _numbers(path, name, camera, "intrinsics", 4)
    width, height = _numbers(path, name, camera, "resolution", 2).tolist()
    dist = np.zeros(0) if lens == "none" else _numbers(path, name, camera, "distortion_coeffs", 4)
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return CameraEntry(name, K, pose[:3, :3], pose[:3, 3], dist, (width, height), lens == "equidistant")
