"""Calibrations exported by Agisoft Metashape as XML."""

import re
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._text import split_numbers
from ._xml import attribute, read_xml

# Metashape's origin is the corner of the first pixel, OpenCV's its centre.
_HALF_PIXEL = 0.5
# Coordinates beyond this (m) are geocentric: a room is smaller and the globe larger.
_GLOBE = 1e6


def read_metashape(path: Path) -> Contents:
    """Read the aligned cameras, named by their labels, in metres if the chunk has a reference.

    ``transform`` of a camera maps its frame (+z forward, y down) to the chunk; that of the chunk, a similarity, maps
    the chunk to the world. The lens is Brown's, as in OpenCV but with the two tangential coefficients exchanged.
    """
    root = read_xml(path)
    chunks = root.findall("chunk")
    if len(chunks) != 1:
        raise fault(path, None, f"holds {len(chunks)} chunks of Metashape; export the cameras of one")
    chunk = chunks[0]
    scale, turn, shift = _placement(path, chunk)
    sensors = {sensor.get("id", ""): sensor for sensor in chunk.findall("sensors/sensor")}
    entries = []
    for camera in chunk.iterfind("cameras//camera"):
        text = camera.findtext("transform")
        if text is None or camera.get("enabled", "true").lower() in ("false", "0"):
            continue
        name = re.sub(r"\.(jpe?g|png|tiff?|bmp)$", "", camera.get("label", "without a label"), flags=re.IGNORECASE)
        sensor = sensors.get(camera.get("sensor_id", ""))
        if sensor is None:
            raise camera_fault(path, name, "its sensor is missing; export the cameras again")
        pose = split_numbers(path, name, "transform", text, 16).reshape(4, 4)
        R = (turn @ pose[:3, :3]).T
        centre = scale * turn @ pose[:3, 3] + shift
        if np.linalg.norm(centre) > _GLOBE:
            raise camera_fault(path, name, "stands somewhere on the globe; choose local coordinates in Metashape")
        entries.append(CameraEntry(name, *_lens(path, name, sensor, R, -R @ centre)))
    return Contents("Metashape", entries, None if scale == 1 else 1.0, None)


def _placement(path: Path, chunk: Element) -> tuple[float, np.ndarray, np.ndarray]:
    """The similarity from chunk to world: scale, rotation and translation; the identity without a reference."""
    found = [*chunk.findall("transform"), *chunk.findall("components/component/transform")]
    if len(found) > 1:
        raise fault(path, None, f"holds {len(found)} components that are not placed alike; export one of them")
    if not found:
        return 1.0, np.eye(3), np.zeros(3)

    def given(tag: str, default: str, count: int) -> np.ndarray:
        return split_numbers(path, "of the chunk", tag, found[0].findtext(tag, default), count)

    scale = float(given("scale", "1", 1)[0])
    if not 1e-9 < scale < 1e9:
        raise fault(path, "scale", f"is {scale:g}; align the cameras again")
    return scale, given("rotation", "1 0 0 0 1 0 0 0 1", 9).reshape(3, 3), given("translation", "0 0 0", 3)


def _lens(
    path: Path, name: str, sensor: Element, R: np.ndarray, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, tuple[float, float]]:
    lenses = sensor.findall("calibration")
    lens = next((lens for lens in lenses if lens.get("class") == "adjusted"), lenses[0] if lenses else None)
    if lens is None:
        raise camera_fault(path, name, "its sensor has no calibration; align the cameras again")
    kinds = {element.get("type", "frame") for element in (sensor, lens)}
    if kinds != {"frame"}:
        raise camera_fault(path, name, f"its sensor is of the type {', '.join(sorted(kinds))}; only frame is read")
    size = lens.find("resolution")
    size = sensor.find("resolution") if size is None else size
    if size is None:
        raise camera_fault(path, name, "its sensor has no resolution; export the cameras again")
    width, height = (float(attribute(path, name, size.attrib, key)[0]) for key in ("width", "height"))

    def given(key: str) -> float:
        return float(split_numbers(path, name, key, lens.findtext(key, "0"), 1)[0])

    if any(given(key) for key in ("k4", "p3", "p4")):
        raise camera_fault(path, name, "its lens has k4, p3 or p4, which OpenCV's has not; align without them")
    f, skew = given("f"), given("b2")
    u, v = width / 2 + given("cx") - _HALF_PIXEL, height / 2 + given("cy") - _HALF_PIXEL
    K = np.array([[f + given("b1"), skew, u], [0.0, f, v], [0.0, 0.0, 1.0]])
    dist = np.array([given(key) for key in ("k1", "k2", "p2", "p1", "k3")])
    return K, R, t, dist, (width, height)
