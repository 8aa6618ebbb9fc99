"""Which part of a Qualisys sensor was filmed, and at how many of its pixels."""

import re
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ._calibration import camera_fault
from ._qualisys_elements import PARTS, name_of, number

# By their rows, those of a sensor in whole: Miqus Video has 1088, Miqus Video Plus 1440.
_RESOLUTIONS = (540, 720, 1080, 1440, 2160)
# Sides are whole pixels, so that a binned image may lack one.
_WHOLE = 0.02


def recorded(path: Path, camera: Element, K: np.ndarray) -> tuple[np.ndarray, tuple[float, float]]:
    """The intrinsics of the recorded images, and their width and height, from the sensor's.

    ``fov_video`` is the recorded part. At a lower ``video_resolution`` that shows the whole sensor, pixels are binned,
    twice two at 540p of 1080p, and the file still has the sensor's numbers (so does Pose2Sim read it). Where the field
    of view itself is given in binned pixels, the sensor's size (``sensorMaxU``) tells.
    """
    name = name_of(camera)

    def box(tag: str) -> tuple[np.ndarray, np.ndarray]:
        left, top, right, bottom = (number(path, camera, tag, key) for key in ("left", "top", "right", "bottom"))
        return np.array([left, top]), np.array([right - left + 1, bottom - top + 1])

    begin, extent = box("fov_video")
    first, whole = box("fov_video_max") if camera.find("fov_video_max") is not None else (begin, extent)
    sensor = _sensor(path, camera)
    sensor = whole if sensor is None else sensor
    if (extent < 1).any() or (whole < 1).any() or (sensor < 1).any():
        raise camera_fault(path, name, "its field of view or its sensor is empty; calibrate it again")
    ratio = sensor / whole
    bins = round(float(ratio[0]))
    if bins > 1 and (first == 0).all() and np.abs(ratio / bins - 1).max() < _WHOLE:
        return _binned(K, bins, begin), (float(extent[0]), float(extent[1]))
    bins = _bins(path, name, camera, min(sensor), min(whole))
    # What was cut off was cut off the sensor.
    K, (width, height) = _binned(K, 1, begin), np.floor(extent / bins)
    return _binned(K, bins, np.zeros(2)), (float(width), float(height))


def _sensor(path: Path, camera: Element) -> np.ndarray | None:
    """Width and height of the sensor (px); the last part of its last pixel is given, or that pixel's first."""
    lens = camera.find("intrinsic")
    if lens is None or "sensorMaxU" not in lens.attrib or "sensorMaxV" not in lens.attrib:
        return None
    last = [number(path, camera, "intrinsic", key) for key in ("sensorMaxU", "sensorMaxV")]
    return np.floor(np.array(last) / PARTS) + 1


def _bins(path: Path, name: str, camera: Element, rows: float, most: float) -> int:
    """How many pixels of the sensor, along each side, make one of the images."""
    text = camera.get("video_resolution", "").strip().lower()
    if text in ("", "n/a", "none"):
        return 1
    if not re.fullmatch(r"[1-9][0-9]{1,4}p", text):
        raise camera_fault(path, name, f"video_resolution {text[:40]!r} is none, such as 1080p; export it again")
    wanted = int(text[:-1])
    full = min(_RESOLUTIONS, key=lambda resolution: abs(resolution - rows))
    # No image is larger than its sensor, and one of which rows were left out is smaller.
    if wanted >= full or most <= wanted:
        return 1
    if full % wanted:
        raise camera_fault(
            path, name, f"video_resolution {text} is neither the sensor's, {full}p, nor half of it or a third: nothing "
            "says how its images come about; record at the whole resolution",
        )  # fmt: skip
    return full // wanted


def _binned(K: np.ndarray, bins: int, begin: np.ndarray) -> np.ndarray:
    """Intrinsics where the middle of a pixel is the mean of the middles of those that make it, from ``begin`` on."""
    K = K.copy()
    K[:2, 2] = (K[:2, 2] + 0.5) / bins - 0.5 - begin
    K[:2, :2] /= bins
    return K
