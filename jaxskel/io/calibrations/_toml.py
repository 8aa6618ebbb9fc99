"""TOML of Pose2Sim, Anipose, FreeMoCap and Caliscope: one table for each camera."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..._runtime.atomic_files import written_whole
from ...cameras import Cameras
from ..files import TOML_LINE, parse_toml
from ._calibration import CameraEntry, Contents, camera_fault
from ._text import natural_order, numbers, read_text, rotation, to_vector

_KEYS = ("size", "matrix", "distortions", "rotation", "translation")
# Caliscope's placeholder for a missing value.
_NULL = "null"
# FreeMoCap's keys, old and new, for a world whose floor is aligned with the board or the feet.
_LEVEL = ("groundplane_calibration", "groundplane_applied", "groundplane_aligned", "aligned")
_MILLIMETRE = 0.001
# Largest file (bytes): a camera takes 1 kB.
_MAX_BYTES = 2_000_000


def read_toml(path: Path) -> Contents:
    """Read the tables that hold a camera.

    Pose2Sim writes metres and a world with Z up; it is recognised by four distortion coefficients, or a file name
    ``Calib...``. FreeMoCap states the length of a board square in the unit of the file: more than one means
    millimetres. Its second version always uses millimetres, and says ``aligned`` if Z is up. Anipose and Caliscope do
    not state a unit; metres are assumed. Cameras are sorted by the names of their tables, cam_2 before cam_10. Those
    that Caliscope ignores are left out, as are cameras without a pose: without rotation and translation, or with
    Caliscope's "null" for them. Its ``rotation_count`` only affects display; the calibration is that of the image as
    recorded.
    """
    table = parse_toml(path, read_text(path, _MAX_BYTES), "export the calibration again")
    nested = table.get("cameras")
    is_caliscope = isinstance(nested, dict)
    found = {
        key: value
        for key, value in (nested if is_caliscope else table).items()
        if isinstance(value, dict) and not value.keys().isdisjoint(_KEYS) and value.get("ignore") is not True
    }
    entries, unposed = [], []
    for key in sorted(found, key=natural_order):
        name = _name(path, f"cam_{key}" if is_caliscope else key, found[key])
        pose = [found[key].get(part) for part in ("rotation", "translation")]
        if _NULL in pose or pose == [None, None]:
            unposed.append(name)
        else:
            entries.append(_entry(path, name, found[key]))
    kind, unit, up = _kind(path, table, is_caliscope, entries)
    return Contents(kind, entries, unit, up, unposed=tuple(unposed))


def _kind(
    path: Path, table: dict[str, Any], is_caliscope: bool, entries: list[CameraEntry]
) -> tuple[str, float, str | None]:
    """The program that wrote the file, its unit (m), and its up axis."""
    metadata = table.get("metadata")
    metadata = metadata if isinstance(metadata, dict) else {}
    if is_caliscope:
        return "Caliscope TOML", 1.0, None
    board = metadata.get("board")
    up = "+Z" if any(metadata.get(key) is True for key in _LEVEL) else None
    if "charuco_square_size" in metadata:
        square = numbers(path, "metadata", "charuco_square_size", metadata["charuco_square_size"], 1)[0]
        return "FreeMoCap TOML", _MILLIMETRE if square > 1 else 1.0, up
    if isinstance(board, dict) and "square_length_mm" in board:
        return "FreeMoCap TOML", _MILLIMETRE, up
    # All programs write four coefficients for a fisheye lens.
    counts = [len(entry.dist) for entry in entries if not entry.fisheye]
    if path.name.startswith("Calib") or (counts and all(count == 4 for count in counts)):
        return "Pose2Sim TOML", 1.0, "+Z"
    return "Anipose TOML", 1.0, None


def write_pose2sim_calibration(path: str | Path, cameras: Cameras) -> None:
    """Write a calibration as Pose2Sim reads it; the readers of Anipose and Caliscope accept it too.

    Args:
        path: File to write; Pose2Sim looks for ``Calib*.toml``.
        cameras: The rig (m), in a world with Z up, as Pose2Sim expects ([`Cameras.rotated`][] rotates a world).
    """
    lines = [TOML_LINE]
    for i, name in enumerate(cameras.names):
        dist = np.asarray(cameras.dist[i])
        # As few coefficients as possible: Pose2Sim writes four, and OpenCV also accepts five or eight.
        count = 8 if dist[5:].any() else 5 if dist[4] else 4  # and a fisheye lens has four
        # A JSON string is valid TOML, except for the one control character that JSON does not escape.
        quoted = json.dumps(name, ensure_ascii=True).replace("\x7f", "\\u007f")
        lines += [
            f"[{quoted}]",
            f"name = {quoted}",
            f"size = {[float(n) for n in cameras.size[i]]}",
            f"matrix = {np.asarray(cameras.K[i]).tolist()}",
            f"distortions = {dist[:count].tolist()}",
            f"rotation = {to_vector(np.asarray(cameras.R[i])).ravel().tolist()}",
            f"translation = {np.asarray(cameras.t[i]).tolist()}",
            f"fisheye = {str(bool(cameras.are_fisheye[i])).lower()}",
            "",
        ]
    lines += ["[metadata]", "adjusted = false", "error = 0.0"]
    with written_whole(Path(path)) as file:
        file.write(("\n".join(lines) + "\n").encode())


def _name(path: Path, key: str, table: dict[str, Any]) -> str:
    name = table.get("name", key)
    if not isinstance(name, str):
        raise camera_fault(path, key, "name is not text")
    return name


def _entry(path: Path, name: str, table: dict[str, Any]) -> CameraEntry:
    fisheye = table.get("fisheye", False)
    if not isinstance(fisheye, bool):
        raise camera_fault(path, name, f"fisheye is {str(fisheye)[:40]!r}; give true or false")
    table = {"size": table.get("image_size"), **table}  # FreeMoCap has used both names
    for missing in _KEYS:
        if table.get(missing) in (None, _NULL):
            raise camera_fault(path, name, f"{missing} is missing; calibrate the camera, or take its table out")
    width, height = numbers(path, name, "size", table["size"], 2).tolist()
    return CameraEntry(
        name=name,
        K=numbers(path, name, "matrix", table["matrix"], 9).reshape(3, 3),
        R=rotation(path, name, "rotation", table["rotation"]),
        t=numbers(path, name, "translation", table["translation"], 3),
        dist=numbers(path, name, "distortions", table["distortions"]),
        size=(width, height),
        fisheye=fisheye,
    )
