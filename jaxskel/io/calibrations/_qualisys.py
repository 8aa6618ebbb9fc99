"""Qualisys Track Manager's calibration, a `.qca.txt` file, which is XML."""

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from .._archive import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._text import natural_order
from ._xml import attribute, read_xml

# Image coordinates are counted in parts of a pixel.
_PARTS = 64.0
# A camera looks along its -z, with y up; OpenCV's looks along +z, with y down.
_FROM_QUALISYS = np.diag([1.0, -1.0, -1.0])
_MILLIMETRE = 0.001


def read_qualisys(path: Path) -> Contents:
    """Read the active cameras, named by their serial numbers; only the video cameras where some are marked as such.

    Lengths are millimetres, the world has Z up. Image coordinates are those of the recorded part of the sensor
    (``fov_video``), as recorded: ``viewrotation`` only says how an image is shown. The lens coefficients are
    OpenCV's and have no unit. (Pose2Sim divides them by 64 too when it converts such a file, as of version 0.10.)
    """
    root = read_xml(path)
    cameras = [camera for camera in root.findall("cameras/camera") if camera.get("active") != "0"]
    if root.tag != "calibration" or not cameras:
        raise fault(path, None, "holds no active camera of a Qualisys calibration; export it again from QTM")
    cameras = [camera for camera in cameras if _is_video(camera)] or cameras
    entries = [_entry(path, camera) for camera in cameras]
    return Contents("Qualisys", sorted(entries, key=lambda e: natural_order(e.name)), _MILLIMETRE, "+Z")


def _is_video(camera: Element) -> bool:
    # Files that were edited or converted have "none".
    model = camera.get("model", "none")
    return "Video" in model or model == "none"


def _entry(path: Path, camera: Element) -> CameraEntry:
    name = camera.get("serial", "without a serial number")
    if camera.get("video_resolution", "N/A") not in ("N/A", "1080p"):
        raise camera_fault(
            path,
            name,
            f"video_resolution {camera.get('video_resolution')} is not the sensor's that the calibration is given "
            "for; record at 1080p",
        )

    def part(tag: str) -> dict[str, str]:
        element = camera.find(tag)
        if element is None:
            raise camera_fault(path, name, f"{tag} is missing; calibrate the camera, or take it out")
        return element.attrib

    def number(tag: str, key: str) -> float:
        return float(attribute(path, name, part(tag), key)[0])

    left, top = number("fov_video", "left"), number("fov_video", "top")
    lens = "intrinsic"
    K = np.array([
        [number(lens, "focalLengthU"), number(lens, "skew") if "skew" in part(lens) else 0.0,
         number(lens, "centerPointU") - _PARTS * left],
        [0.0, number(lens, "focalLengthV"), number(lens, "centerPointV") - _PARTS * top],
        [0.0, 0.0, _PARTS],
    ]) / _PARTS  # fmt: skip
    turn = [[number("transform", f"r{row}{column}") for column in (1, 2, 3)] for row in (1, 2, 3)]
    R = _FROM_QUALISYS @ np.array(turn)
    centre = np.array([number("transform", axis) for axis in "xyz"])
    dist = [
        number(lens, key)
        for key in ("radialDistortion1", "radialDistortion2", "tangentalDistortion1", "tangentalDistortion2")
    ]
    if "radialDistortion3" in part(lens):
        dist.append(number(lens, "radialDistortion3"))
    size = number("fov_video", "right") - left + 1, number("fov_video", "bottom") - top + 1
    return CameraEntry(name, K, R, -R @ centre, np.array(dist), size)
