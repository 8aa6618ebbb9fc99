"""Calibrations of OptiTrack's Motive since version 3.2: `.mcal`, which is XML in UTF-16."""

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._text import read_text
from ._xml import attribute, parse_xml

SUFFIX, ROOT = ".mcal", "calibrationProfile"
BINARY = (
    "is not text: calibrations of Motive before version 3.2 (.cal) are binary and not read; open it in a newer Motive "
    "and export a .mcal file"
)
"""The message for files of older versions."""
_MAX_BYTES = 8_000_000  # bytes; the file also holds masks of the images
# Identifiers of cameras that film: Prime Color; and grey and compressed video of the others.
_COLOUR, _FILMS = "30", ("1", "6")
# A camera looks along its -z, with y up; OpenCV's looks along +z, with y down.
_FROM_MOTIVE = np.diag([1.0, -1.0, -1.0])
_LENS = ("k1", "k2", "TangentialX", "TangentialY", "k3")


def read_motive(path: Path) -> Contents:
    """Read the cameras, named by their serial numbers; only those that film, if some do.

    The world has Y up, in metres. ``Extrinsic`` holds the optical centre and, by rows, the rotation from camera to
    world. ``IntrinsicStandardCameraModel`` is OpenCV's lens; ``Intrinsic``, Motive's own, is ignored.
    """
    try:
        root = parse_xml(path, read_text(path, _MAX_BYTES, "utf-16", "no UTF-16"))
    except ValueError:
        # Edited files may have another encoding.
        root = parse_xml(path, read_text(path, _MAX_BYTES))
    cameras = root.findall("Calibration/Cameras/Camera")
    if not cameras:
        raise fault(path, None, "holds no camera of a calibration by Motive; export the .mcal file again")
    cameras = [camera for camera in cameras if _films(camera)] or cameras
    return Contents("Motive", [_entry(path, camera) for camera in cameras], 1.0, "+Y")


def _films(camera: Element) -> bool:
    given = camera.find("Properties")
    return given is not None and (given.get("ImagerIndex") == _COLOUR or given.get("VideoType") in _FILMS)


def _entry(path: Path, camera: Element) -> CameraEntry:
    name = camera.get("Serial", "without a serial number")

    def given(tag: str, *keys: str) -> list[float]:
        element = camera.find(tag)
        if element is None:
            raise camera_fault(path, name, f"{tag} is missing; calibrate the camera and export the .mcal file again")
        return [float(attribute(path, name, element.attrib, key)[0]) for key in keys]

    lens = "IntrinsicStandardCameraModel"
    fx, fy, cx, cy = given(lens, "HorizontalFocalLength", "VerticalFocalLength", "LensCenterX", "LensCenterY")
    width, height = given("Attributes", "ImagerPixelWidth", "ImagerPixelHeight")
    turn = np.array(given("Extrinsic", *(f"OrientMatrix{i}" for i in range(9)))).reshape(3, 3)
    R = _FROM_MOTIVE @ turn.T
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    centre = np.array(given("Extrinsic", "X", "Y", "Z"))
    return CameraEntry(name, K, R, -R @ centre, np.array(given(lens, *_LENS)), (width, height))
