"""Determines which part of a Qualisys sensor was filmed, and with how much binning."""

import re
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ._calibration import camera_fault
from ._qualisys_elements import PARTS, name_of, number

# Rows of the video resolutions that show the whole sensor: Miqus Video has 1088, Miqus Video Plus 1440.
_RESOLUTIONS = (540, 720, 1080, 1440, 2160)
# Relative tolerance: sides are whole pixels, so a binned image may lack one.
_WHOLE = 0.02


def recorded(path: Path, camera: Element, K: np.ndarray) -> tuple[np.ndarray, tuple[float, float]]:
    """The intrinsics (px) of the recorded images, and their width and height (px), from those of the sensor.

    ``fov_video`` is the recorded part. At a lower ``video_resolution`` that shows the whole sensor, pixels are binned,
    two by two at 540p of 1080p, and the file keeps the sensor's numbers (Pose2Sim reads it so too). If the field of
    view itself is in binned pixels, the sensor's size (``sensorMaxU``) reveals it.
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
    # The crop is in sensor pixels.
    K, (width, height) = _binned(K, 1, begin), np.floor(extent / bins)
    return _binned(K, bins, np.zeros(2)), (float(width), float(height))


def _sensor(path: Path, camera: Element) -> np.ndarray | None:
    """Width and height of the sensor (px); files give either the end or the start of its last pixel."""
    lens = camera.find("intrinsic")
    if lens is None or "sensorMaxU" not in lens.attrib or "sensorMaxV" not in lens.attrib:
        return None
    last = [number(path, camera, "intrinsic", key) for key in ("sensorMaxU", "sensorMaxV")]
    return np.floor(np.array(last) / PARTS) + 1


def _bins(path: Path, name: str, camera: Element, rows: float, most: float) -> int:
    """Binning factor: sensor pixels along each side of an image pixel."""
    text = camera.get("video_resolution", "").strip().lower()
    if text in ("", "n/a", "none"):
        return 1
    if not re.fullmatch(r"[1-9][0-9]{1,4}p", text):
        raise camera_fault(path, name, f"video_resolution {text[:40]!r} is none, such as 1080p; export it again")
    wanted = int(text[:-1])
    full = min(_RESOLUTIONS, key=lambda resolution: abs(resolution - rows))
    # No image is larger than its sensor, and one with fewer rows than the sensor may be cropped rather than binned.
    if wanted >= full or most <= wanted:
        return 1
    if full % wanted:
        raise camera_fault(
            path, name, f"video_resolution {text} is neither the sensor's, {full}p, nor half of it or a third: nothing "
            "says how its images come about; record at the whole resolution",
        )  # fmt: skip
    return full // wanted


def _binned(K: np.ndarray, bins: int, begin: np.ndarray) -> np.ndarray:
    """Intrinsics after binning from ``begin`` on; a pixel's centre is the mean of those that form it."""
    K = K.copy()
    K[:2, 2] = (K[:2, 2] + 0.5) / bins - 0.5 - begin
    K[:2, :2] /= bins
    return K
