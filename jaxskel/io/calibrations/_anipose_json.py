"""Calibrations of the AIST Dance Video Database in the JSON of AIST++: a list of cameras with Anipose's keys."""

import re
from pathlib import Path
from typing import Any

from ._calibration import CameraEntry, Contents, camera_fault
from ._json import given
from ._text import rotation

_KEYS = {"name", "size", "matrix", "distortions", "rotation", "translation"}
_CENTIMETRE = 0.01
# Names of AIST's nine cameras.
_NAMES = re.compile(r"c\d\d")


def is_anipose_list(table: Any) -> bool:
    """Whether JSON is a list of cameras with Anipose's keys."""
    return isinstance(table, list) and any(isinstance(camera, dict) and camera.keys() >= _KEYS for camera in table)


def read_anipose_list(path: Path, table: Any) -> Contents:
    """Read `settingN.json` of AIST++, in centimetres.

    The file states no unit: if the cameras do not have AIST's names c01 to c09, the unit is the metre, as in Anipose's
    TOML.
    """
    entries = [_entry(path, i, camera) for i, camera in enumerate(table)]
    if all(_NAMES.fullmatch(entry.name) for entry in entries):
        return Contents("AIST++ JSON", entries, _CENTIMETRE, None)
    return Contents("Anipose JSON", entries, 1.0, None)


def _entry(path: Path, index: int, camera: Any) -> CameraEntry:
    name = camera.get("name") if isinstance(camera, dict) else None
    if not isinstance(name, str):
        raise camera_fault(path, f"number {index}", "name is missing or no text")
    width, height = given(path, name, camera, "size", 2).tolist()
    return CameraEntry(
        name=name,
        K=given(path, name, camera, "matrix", 9).reshape(3, 3),
        R=rotation(path, name, "rotation", given(path, name, camera, "rotation", 3, 9)),
        t=given(path, name, camera, "translation", 3),
        dist=given(path, name, camera, "distortions"),
        size=(width, height),
        fisheye=camera.get("fisheye") is True,
    )
