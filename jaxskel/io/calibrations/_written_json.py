"""Cameras in hand-written JSON: one object for each camera, with a matrix K, a rotation and a translation."""

from pathlib import Path
from typing import Any

from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._json import table_of
from ._json_lens import has_lens, read_lens
from ._json_pose import read_pose
from ._text import natural_order, numbers

FORMAT = "JSON (K, R, t)"
_NAMES = ("name", "camera_name", "cam_name", "id", "cam_id", "camera_id", "camera", "serial", "serial_number")
_PARTS = ("intrinsics", "intrinsic", "extrinsics", "extrinsic", "distortion", "pose", "calibration", "parameters")
_UNITS = {
    1.0: ("m", "metre", "metres", "meter", "meters"),
    0.01: ("cm", "centimetre", "centimetres", "centimeter", "centimeters"),
    0.001: ("mm", "millimetre", "millimetres", "millimeter", "millimeters"),
}
_SIDES = (("width", "height"), ("w", "h"), ("W", "H"), ("image_width", "image_height"), ("img_width", "img_height"))
_SIZES = ("size", "image_size", "img_size", "imageSize", "resolution")


def cameras_in(path: Path, table: Any) -> dict[str, dict[str, Any]]:
    """The cameras of a file by name; empty if it holds no matrix K.

    An object of cameras or a list of them, at the top level or under ``cameras``, possibly beside a lens that all of
    them share; or a single camera, named after its file.
    """
    shared = {}
    group = table
    if isinstance(table, dict):
        group = table.get("cameras", table)
        shared = _flat({key: value for key, value in table.items() if key != "cameras"})
        if group is table and has_lens(shared):
            return {_named(table, path.stem): shared}
        shared = shared if has_lens(shared) else {}
    if isinstance(group, dict):
        named = [(key, group[key]) for key in sorted(group, key=natural_order)]
    elif isinstance(group, list):
        named = [(_named(each, f"cam{i}"), each) for i, each in enumerate(group) if isinstance(each, dict)]
    else:
        return {}
    found = [(name, shared | _flat(each)) for name, each in named if isinstance(each, dict)]
    found = [(name, each) for name, each in found if has_lens(each)]
    cameras = dict(found)
    if len(cameras) < len(found):
        names = [name for name, _ in found]
        double = next(name for i, name in enumerate(names) if name in names[:i])
        raise camera_fault(path, double, "is there twice; give every camera a name of its own")
    return cameras


def read_written(path: Path, table: Any, cameras: dict[str, dict[str, Any]]) -> Contents:
    """Read cameras with unambiguous keys; ``unit`` may state their unit, and metres are the default.

    See `read_lens` and `read_pose` for the keys. If a key has two meanings, the common one is used and checked against
    the rest of the file; a key without a common meaning is refused.
    """
    unposed, entries = [], []
    for name, camera in cameras.items():
        pose = read_pose(path, name, camera)
        if pose is None:
            unposed.append(name)
            continue
        lens = read_lens(path, name, camera)
        entries.append(CameraEntry(name, lens.K, *pose, lens.dist, _size(path, name, camera), lens.fisheye))
    if not entries:
        raise fault(
            path, None, "none of its cameras has a pose under a key that is known; give R (or rvec) and t with "
            "x_cam = R x + t, world to camera",
        )  # fmt: skip
    units = {_unit(path, name, camera) for name, camera in cameras.items()}
    if isinstance(table, dict):
        units.add(_unit(path, "of all files", table))
    units.discard(None)
    if len(units) > 1:
        raise fault(path, "unit", "differs between the cameras; keep one")
    return Contents(FORMAT, entries, units.pop() if units else 1.0, None, unposed=tuple(unposed))


def _flat(camera: dict[str, Any]) -> dict[str, Any]:
    """A camera with nested objects, such as its intrinsics, merged into it; keys of the camera itself win."""
    flat = {}
    for part in _PARTS:
        inner = camera.get(part)
        if isinstance(inner, dict) and "data" not in inner:
            flat.update(inner)
    return flat | {key: value for key, value in camera.items() if key not in _PARTS or not isinstance(value, dict)
                   or "data" in value}  # fmt: skip


def _named(camera: Any, otherwise: str) -> str:
    for key in _NAMES:
        value = camera.get(key)
        if isinstance(value, str) and value or type(value) is int and 0 <= value < 10**9:
            return str(value)
    return otherwise


def _unit(path: Path, name: str, table: dict[str, Any]) -> float | None:
    key = next((key for key in ("unit", "units") if key in table), None)
    if key is None:
        return None
    word = table[key]
    for metres, words in _UNITS.items():
        if isinstance(word, str) and word.lower() in words:
            return metres
    raise camera_fault(path, name, f"{key} is {str(word)[:40]!r}; give m, cm or mm")


def _size(path: Path, name: str, camera: dict[str, Any]) -> tuple[float, float] | None:
    for keys in _SIDES:
        if all(camera.get(key) is not None for key in keys):
            width, height = (float(numbers(path, name, key, camera[key], 1)[0]) for key in keys)
            return width, height
    for key in _SIZES:
        if isinstance(camera.get(key), dict):
            return _size(path, name, table_of(path, name, key, camera[key]))
        if camera.get(key) is not None:
            width, height = numbers(path, name, key, camera[key], 2).tolist()
            return width, height
    return None
