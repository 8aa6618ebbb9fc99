"""TOML of Pose2Sim, Anipose, FreeMoCap and Caliscope: one table a camera."""

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
# What Caliscope writes where it has nothing.
_NULL = "null"
# FreeMoCap's words, old and new, for a world whose floor is the board's or the feet's.
_LEVEL = ("groundplane_calibration", "groundplane_applied", "groundplane_aligned", "aligned")
_MILLIMETRE = 0.001
# A camera takes 1 kB.
_MAX_BYTES = 2_000_000


def read_toml(path: Path) -> Contents:
    """Read the tables that hold a camera.

    Pose2Sim writes metres and a world with Z up; it alone gives four distortions, or names its file ``Calib...``.
    FreeMoCap writes down how long a square of its board is, in the unit of the file: more than one is millimetres. Its
    second version always has millimetres, and says ``aligned`` where Z is up. Anipose and Caliscope do not state a
    unit: metres are taken. Cameras come in the order of their tables' names, cam_2 before cam_10, and those that
    Caliscope ignores are left out, as are cameras that were not posed: without rotation and translation, or with
    Caliscope's "null" for them. Its ``rotation_count`` says how an image is shown; the calibration is that of the
    image as recorded.
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
    """Whose file it is, its unit, and what is up."""
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
    # Of a fisheye lens all tools give four.
    counts = [len(entry.dist) for entry in entries if not entry.fisheye]
    if path.name.startswith("Calib") or (counts and all(count == 4 for count in counts)):
        return "Pose2Sim TOML", 1.0, "+Z"
    return "Anipose TOML", 1.0, None


def write_pose2sim_calibration(path: str | Path, cameras: Cameras) -> None:
    """Write a calibration as Pose2Sim reads it, which Anipose's and Caliscope's readers take too.

    Args:
        path: File to write; Pose2Sim looks for ``Calib*.toml``.
        cameras: The rig, in a world with Z up, as Pose2Sim takes it to be ([`Cameras.rotated`][] turns a world).
    """
    lines = [TOML_LINE]
    for i, name in enumerate(cameras.names):
        dist = np.asarray(cameras.dist[i])
        # As few as hold the lens: Pose2Sim writes four, and OpenCV takes five or eight in their place.
        count = 8 if dist[5:].any() else 5 if dist[4] else 4  # and a fisheye lens has four
        # TOML takes a JSON string, but for the one control character that JSON leaves as it is.
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
    table = {"size": table.get("image_size"), **table}  # FreeMoCap has had both names
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
