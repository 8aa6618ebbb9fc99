"""XML elements of Qualisys' calibrations, which Theia3D uses too."""

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._text import natural_order
from ._xml import attribute, read_xml

PARTS = 64.0
"""Units of image coordinates in a pixel, in Qualisys' files."""
_MILLIMETRE = 0.001
# Largest sensor width in pixels; in 64ths of a pixel every sensor exceeds it.
_WIDEST = 16384
# The sensor size is 1 times the field of view if both have the same unit, otherwise 64 times; this separates the cases.
_ALIKE = 8.0


def calibrated_cameras(path: Path) -> list[Element]:
    """The active cameras of a file with Qualisys' elements."""
    root = read_xml(path)
    found = root if root.tag == "calibration" else root.find("calibration")
    if found is None:
        raise fault(
            path, None, f"<{root.tag[:40]}> holds no element calibration; ask QTM for that one of its parameters, or "
            "export a .qca.txt file",
        )  # fmt: skip
    if found.get("calibrated", "").lower() == "false":
        raise fault(path, None, "says calibrated = false; calibrate the cameras in QTM")
    cameras = [camera for camera in found.findall("cameras/camera") if _is_set(camera, "active")]
    cameras = [camera for camera in cameras if _is_set(camera, "calibrated")]
    if not cameras:
        raise fault(path, None, "holds no active camera of a Qualisys calibration; export it again from QTM")
    return cameras


def in_pixels(camera: Element) -> bool:
    """Whether a camera's sensor is measured in pixels, as in Theia3D, rather than in 64ths of a pixel."""
    try:
        sensor = float(camera.find("intrinsic").get("sensorMaxU", "nan"))  # pyright: ignore[reportOptionalMemberAccess]
        extents = [
            float(fov.get("right", "nan")) - float(fov.get("left", "nan")) + 1
            for fov in (camera.find(tag) for tag in ("fov_video_max", "fov_marker_max", "fov_video")) if fov is not None
        ]  # fmt: skip
    except (AttributeError, ValueError):  # reported by the reader of the camera
        return False
    largest = max(extents, default=0.0)
    return 1 / _ALIKE < sensor / largest < _ALIKE if largest > 0 else 0 < sensor < _WIDEST


def sorted_contents(name: str, entries: list[CameraEntry], up: str | None) -> Contents:
    """The cameras sorted by name, cam_2 before cam_10."""
    return Contents(name, sorted(entries, key=lambda e: natural_order(e.name)), _MILLIMETRE, up)


def part(path: Path, camera: Element, tag: str) -> dict[str, str]:
    """The attributes of a required element of a camera."""
    element = camera.find(tag)
    if element is None:
        raise camera_fault(path, name_of(camera), f"{tag} is missing; calibrate the camera, or take it out")
    return element.attrib


def number(path: Path, camera: Element, tag: str, key: str) -> float:
    """A numeric attribute of a required element of a camera."""
    return float(attribute(path, name_of(camera), part(path, camera, tag), key)[0])


def name_of(camera: Element) -> str:
    """A camera's serial number."""
    return camera.get("serial", "without a serial number")


def intrinsics(path: Path, camera: Element, parts: float) -> tuple[np.ndarray, np.ndarray]:
    """K (px) from coordinates in units of 1/``parts`` pixel, and OpenCV's lens coefficients."""

    def lens(key: str) -> float:
        return number(path, camera, "intrinsic", key)

    given = part(path, camera, "intrinsic")
    K = np.array([
        [lens("focalLengthU"), lens("skew") if "skew" in given else 0.0, lens("centerPointU")],
        [0.0, lens("focalLengthV"), lens("centerPointV")],
        [0.0, 0.0, parts],
    ]) / parts  # fmt: skip
    dist = [
        lens(key) for key in ("radialDistortion1", "radialDistortion2", "tangentalDistortion1", "tangentalDistortion2")
    ]
    if "radialDistortion3" in given:
        dist.append(lens("radialDistortion3"))
    return K, np.array(dist)


def transform(path: Path, camera: Element) -> tuple[np.ndarray, np.ndarray]:
    """The 3 x 3 matrix of a camera's transform, by rows, and its vector (file's unit)."""
    turn = [[number(path, camera, "transform", f"r{row}{column}") for column in (1, 2, 3)] for row in (1, 2, 3)]
    return np.array(turn), np.array([number(path, camera, "transform", axis) for axis in "xyz"])


def _is_set(camera: Element, key: str) -> bool:
    return camera.get(key, "1").strip().lower() not in ("0", "false")
