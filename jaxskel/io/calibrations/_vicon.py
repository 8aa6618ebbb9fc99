"""Vicon's calibration, an `.xcp` file, which is XML."""

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ..files import fault
from ._calibration import CameraEntry, Contents, camera_fault
from ._text import from_quaternion, numbers, split_numbers, to_number
from ._xml import attribute, read_xml

_MILLIMETRE = 0.001
# px: largest distance of the distortion centre from the principal point, which coincide in OpenCV.
_SAME_POINT = 0.1
# px: largest error of OpenCV's lens model fitted to Vicon's, well below the accuracy of a silhouette's edge.
_CLOSE = 0.05
_SAMPLES = 400


def read_vicon(path: Path) -> Contents:
    """Read the cameras, named by their ``DEVICEID``; only the video cameras if some are marked as such.

    Lengths are millimetres, the world has Z up; ``ORIENTATION`` is the rotation from world to camera and ``POSITION``
    the optical centre. Vicon's lens model maps distorted to undistorted pixels by a polynomial of the radius in pixels;
    OpenCV's model is the inverse map and is fitted to it over the image.
    """
    root = read_xml(path)
    cameras = root.findall("Camera")
    if root.tag != "Cameras" or not cameras:
        raise fault(path, None, "holds no camera of a Vicon calibration; export the .xcp file again")
    cameras = [camera for camera in cameras if _is_video(camera)] or cameras
    return Contents("Vicon", [_entry(path, camera) for camera in cameras], _MILLIMETRE, "+Z")


def _is_video(camera: Element) -> bool:
    marks = " ".join(camera.get(key, "") for key in ("TYPE", "DISPLAY_TYPE")).lower()
    return "video" in marks or "vue" in marks


def _entry(path: Path, camera: Element) -> CameraEntry:
    name = camera.get("DEVICEID", "without a DEVICEID")
    frames = camera.findall("KeyFrames/KeyFrame")
    if not frames:
        raise camera_fault(path, name, "has no KeyFrame; calibrate the camera, or take it out")
    given = frames[0].attrib
    focal = attribute(path, name, given, "FOCAL_LENGTH")[0]
    aspect = split_numbers(path, name, "PIXEL_ASPECT_RATIO", camera.get("PIXEL_ASPECT_RATIO", "1"), 1)[0]
    if focal < 1 or not 0.1 < aspect < 10:
        raise camera_fault(
            path, name, f"FOCAL_LENGTH {focal:g} px or PIXEL_ASPECT_RATIO {aspect:g} is no camera's; calibrate it again"
        )
    middle = attribute(path, name, given, "PRINCIPAL_POINT", 2)
    width, height = attribute(path, name, camera.attrib, "SENSOR_SIZE", 2).tolist()
    R = from_quaternion(path, name, "ORIENTATION", attribute(path, name, given, "ORIENTATION", 4))
    radial = _radial(path, name, given, middle)
    if radial.any() and aspect != 1:
        raise camera_fault(
            path, name, "has a distorted lens and pixels that are not square; undistort its images first"
        )
    # At least one pixel, even if the sensor size is invalid: the validation of all formats reports that.
    corner = max(1.0, np.hypot(*(np.maximum(np.abs(middle), np.abs(np.array([width, height]) - middle)))))
    return CameraEntry(
        name=name,
        K=np.array([[focal, 0.0, middle[0]], [0.0, focal / aspect, middle[1]], [0.0, 0.0, 1.0]]),
        R=R,
        t=-R @ attribute(path, name, given, "POSITION", 3),
        dist=_opencv_lens(path, name, radial, float(focal), float(corner)),
        size=(width, height),
    )


def _radial(path: Path, name: str, given: dict[str, str], middle: np.ndarray) -> np.ndarray:
    """Coefficients of the second, fourth and sixth power of the radius in pixels; older files lack the last."""
    if "VICON_RADIAL2" in given:
        model, *words = given["VICON_RADIAL2"].split() or [""]
        if model != "Vicon3Parameter":
            raise camera_fault(path, name, f"VICON_RADIAL2 is of the model {model!r}; only Vicon3Parameter is read")
        found = numbers(path, name, "VICON_RADIAL2", [to_number(word) for word in words], 5)
        if found[2:].any() and np.abs(found[:2] - middle).max() > _SAME_POINT:
            raise camera_fault(
                path, name, "VICON_RADIAL2 and PRINCIPAL_POINT have different centres; undistort its images first"
            )
        return found[2:]
    found = split_numbers(path, name, "VICON_RADIAL", given.get("VICON_RADIAL", "0 0"), 2)
    return np.append(found, 0.0)


def _opencv_lens(path: Path, name: str, radial: np.ndarray, focal: float, corner: float) -> np.ndarray:
    """OpenCV's k1, ..., k6 for a lens model that maps distorted to undistorted pixels.

    OpenCV maps an undistorted radius r to ``r (1 + k1 r^2 + ...) / (1 + k4 r^2 + ...)``, which is linear in the
    coefficients after multiplying out. Radii are normalised by that of the farthest corner for the fit.
    """
    if not radial.any():
        return np.zeros(8)
    seen = np.linspace(0.0, corner, _SAMPLES + 1)[1:]
    ideal = seen * (1 + seen**2 * (radial[0] + seen**2 * (radial[1] + seen**2 * radial[2])))
    scale = ideal[-1]
    if (np.diff(ideal) <= 0).any() or not 0.5 < scale / corner < 2 or ideal[0] <= 0:
        raise camera_fault(path, name, "its lens folds the image; calibrate the camera again")
    powers = ((ideal / scale) ** 2)[:, None] ** np.arange(1, 4)
    ratio = seen / ideal
    # Weight by the radius, to minimise an error in pixels.
    system = np.concatenate([powers, -ratio[:, None] * powers], axis=1) * ideal[:, None]
    k = np.linalg.lstsq(system, (ratio - 1) * ideal, rcond=None)[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.abs(ideal * (1 + powers @ k[:3]) / (1 + powers @ k[3:]) - seen).max()
    if not off < _CLOSE:
        raise camera_fault(path, name, f"its lens is {off:.2g} px away from OpenCV's model; undistort its images first")
    k = k / (scale / focal) ** (2 * np.tile(np.arange(1, 4), 2))
    return np.array([k[0], k[1], 0.0, 0.0, *k[2:]])
