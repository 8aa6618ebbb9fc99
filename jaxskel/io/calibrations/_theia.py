"""Theia3D's calibration: Qualisys' elements, but in pixels and with poses from world to camera."""

from pathlib import Path
from xml.etree.ElementTree import Element

from ._calibration import CameraEntry, Contents, camera_fault
from ._qualisys_elements import calibrated_cameras, in_pixels, intrinsics, name_of, number, sorted_contents, transform


def is_theia(path: Path) -> bool:
    """Whether all cameras of a file with Qualisys' elements have their sensors in pixels.

    The file does not name the program. Qualisys uses 64ths of a pixel: with the wrong unit, the image centre would lie
    in the first few pixels, or the sensor would have tens of thousands of them.
    """
    return all(in_pixels(camera) for camera in calibrated_cameras(path))


def read_theia(path: Path) -> Contents:
    """Read the active cameras, named by their serial numbers, in millimetres.

    ``transform`` maps the world to a camera that looks along +z with y down: its vector is not the optical centre.
    """
    return sorted_contents("Theia3D", [_entry(path, camera) for camera in calibrated_cameras(path)], None)


def _entry(path: Path, camera: Element) -> CameraEntry:
    K, dist = intrinsics(path, camera, 1.0)
    R, t = transform(path, camera)
    width, height = (
        number(path, camera, "intrinsic", f"sensorMax{axis}") - number(path, camera, "intrinsic", f"sensorMin{axis}")
        for axis in "UV"
    )
    if not (0 < K[0, 2] < width and 0 < K[1, 2] < height):
        raise camera_fault(
            path,
            name_of(camera),
            f"the middle of its image, {K[0, 2]:g}, {K[1, 2]:g}, lies outside of its {width:g} x {height:g} px; a file "
            "like Qualisys' whose sensors are counted in pixels is read as Theia3D's: export it again",
        )
    return CameraEntry(name_of(camera), K, R, t, dist, (width, height))
