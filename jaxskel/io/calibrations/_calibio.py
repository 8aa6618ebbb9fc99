"""Calibrations of calib.io's Camera Calibrator: the JSON of its library libCalib."""

from pathlib import Path
from typing import Any

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._json import given, table_of
from ._text import from_quaternion, from_vector

# In OpenCV's order; longer models than the supported ones are accepted if the further coefficients are zero.
_OPENCV = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tauX", "tauY")
# The coefficients of each model in OpenCV's order, and whether the model is that of cv2.fisheye.
_MODELS = {
    "CameraModelOpenCV": (_OPENCV, False),
    "CameraModelMatlab": (("k1", "k2", "p1", "p2", "k3"), False),
    "CameraModelPinhole": ((), False),
    "CameraModelOpenCVFisheye": (("k1", "k2", "k3", "k4"), True),
}
# Bit of a class number in the archive that says that the class name follows.
_NAME_FOLLOWS = 1 << 31


def is_calibio(table: Any) -> bool:
    """Whether JSON is an archive of libCalib."""
    calibration = table.get("Calibration") if isinstance(table, dict) else None
    return isinstance(calibration, dict) and "cameras" in calibration


def read_calibio(path: Path, table: dict[str, Any]) -> Contents:
    """Read all cameras, named cam0, cam1, ..., or by their serial numbers if the file has them.

    Lengths are metres, in the frame of the first camera; ``transform`` goes from there to the camera. The focal length
    is ``f`` horizontally and ``f ar`` vertically; integer coordinates are pixel centres.
    """
    cameras = table["Calibration"]["cameras"]
    if not isinstance(cameras, list):
        raise fault(path, "Calibration.cameras", "is no list; export the calibration again")
    tables = [table_of(path, f"cam{i}", "the camera", camera) for i, camera in enumerate(cameras)]
    serials = [str(camera.get("serial") or "") for camera in tables]
    named = all(serials) and len(set(serials)) == len(serials)
    names = serials if named else [f"cam{i}" for i in range(len(tables))]
    unposed, entries = [], []
    models: dict[Any, str] = {}
    for name, camera in zip(names, tables, strict=True):
        model = table_of(path, name, "model", camera.get("model"))
        kind = _model(path, name, model, models)
        if camera.get("transform") is None:
            unposed.append(name)
        else:
            entries.append(_entry(path, name, camera, model, kind))
    return Contents("calib.io JSON", entries, 1.0, None, unposed=tuple(unposed))


def _model(path: Path, name: str, model: dict[str, Any], models: dict[Any, str]) -> str:
    """The name of a lens model, which an archive states only for the first camera that has it."""
    number, kind = model.get("polymorphic_id"), model.get("polymorphic_name")
    number = number & ~_NAME_FOLLOWS if type(number) is int else None
    if isinstance(kind, str):
        models[number] = kind.rpartition("::")[2]
    found = models.get(number, "without a name")
    if found not in _MODELS:
        raise camera_fault(
            path, name, f"has the lens model {found[:60]}, which is not read; calibrate with {', '.join(_MODELS)}"
        )
    return found


def _entry(path: Path, name: str, camera: dict[str, Any], model: dict[str, Any], kind: str) -> CameraEntry:
    data = table_of(path, name, "data", table_of(path, name, "ptr_wrapper", model.get("ptr_wrapper")).get("data"))
    parameters = table_of(path, name, "parameters", data.get("parameters"))

    def value(key: str, default: float | None = None) -> float:
        if default is not None and key not in parameters:
            return default
        return float(given(path, name, table_of(path, name, key, parameters.get(key)), "val", 1)[0])

    f, coefficients = value("f"), _MODELS[kind]
    keys, is_fisheye = coefficients
    R, t = _pose(path, name, table_of(path, name, "transform", camera["transform"]))
    return CameraEntry(
        name=name,
        K=np.array([[f, value("skew", 0.0), value("cx")], [0.0, f * value("ar", 1.0), value("cy")], [0.0, 0.0, 1.0]]),
        R=R,
        t=t,
        dist=np.array([value(key, 0.0) for key in keys]),
        size=_size(path, name, data),
        fisheye=is_fisheye,
    )


def _pose(path: Path, name: str, transform: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    turn = table_of(path, name, "rotation", transform.get("rotation"))
    shift = table_of(path, name, "translation", transform.get("translation"))
    keys = ("rx", "ry", "rz") if "rx" in turn else ("qx", "qy", "qz", "qw")
    found = np.array([given(path, name, turn, key, 1)[0] for key in keys])
    into = from_vector if len(found) == 3 else from_quaternion
    t = np.array([given(path, name, shift, key, 1)[0] for key in "xyz"])
    return into(path, name, "rotation", found), t


def _size(path: Path, name: str, data: dict[str, Any]) -> tuple[float, float] | None:
    """Width and height (px), stored in the model's innermost base, whose depth differs between models."""
    base: Any = data
    while isinstance(base, dict):
        size = base.get("imageSize", base)
        for keys in (("width", "height"), ("imageWidth", "imageHeight")):
            if isinstance(size, dict) and size.keys() >= set(keys):
                width, height = (float(given(path, name, size, key, 1)[0]) for key in keys)
                return width, height
        base = next((value for key, value in base.items() if key.startswith("CameraModel")), None)
    return None
