"""The validated type that every calibration file is read into, and its validation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...cameras import COEFFICIENTS, FISHEYE_COEFFICIENTS, Cameras, make_cameras
from ..files import fault

# Largest distance of a camera from the origin (m): in a larger rig the unit is most likely the millimetre.
_FARTHEST_CAMERA = 100.0
# Smallest distance between cameras that see one person from several sides (m); millimetres that were divided by 1000
# once too often fall below it.
_NARROWEST_RIG = 0.1


@dataclass(frozen=True)
class Calibration:
    """A calibrated rig from a file, in metres and in OpenCV's convention (world to camera).

    Attributes:
        cameras: The rig, validated (extrinsics in m, intrinsics in px).
        up: World axis that points up, such as "+Z", as the format states or implies; None if it does neither.
        format: Name of the recognised format, such as "Qualisys", for messages.
        unposed: Names of cameras without a pose in the file, which are left out.
    """

    cameras: Cameras
    up: str | None
    format: str
    unposed: tuple[str, ...] = ()


@dataclass(frozen=True)
class CameraEntry:
    """One camera as its file describes it, in OpenCV's convention but in the file's unit of length.

    Attributes:
        dist: OpenCV's coefficients; for a fisheye lens the four of `cv2.fisheye`.
        fisheye: Whether the lens model is that of `cv2.fisheye`.
    """

    name: str
    K: np.ndarray
    R: np.ndarray
    t: np.ndarray
    dist: np.ndarray
    size: tuple[float, float] | None
    fisheye: bool = False


@dataclass(frozen=True)
class Contents:
    """The result of a reader, not yet validated.

    Attributes:
        unit: Metres per unit of the file; None if the format has no scale.
        unposed: Names of cameras without a pose, which are not among the entries.
        scale_is: How the user can find the scale if the format has none.
    """

    format: str
    entries: list[CameraEntry]
    unit: float | None
    up: str | None
    unposed: tuple[str, ...] = ()
    scale_is: str = "measure a length in the scene and give unit, the metres per unit of the file"


def camera_fault(path: Path, camera: str, message: str) -> ValueError:
    """The error for a fault of one camera of a file, in one line."""
    return fault(path, None, f"camera {camera}: {message}")


def validated(
    path: Path, contents: Contents, unit: float | None, sizes: Mapping[str, tuple[int, int]] | None
) -> Calibration:
    """Validate the result of a reader, and convert it to metres.

    Raises:
        ValueError: The cameras cannot be real ones; one line that names the file and the camera.
    """
    entries = contents.entries
    if not entries:
        told = (
            f"none of its cameras ({', '.join(contents.unposed)}) was posed" if contents.unposed else "holds no camera"
        )
        raise fault(path, None, f"{told}, read as {contents.format}; calibrate the rig and export it again")
    names = [entry.name for entry in entries]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise camera_fault(path, name, "is there twice; give every camera a name of its own")
    dist = np.zeros((len(entries), COEFFICIENTS))
    for row, entry in zip(dist, entries, strict=True):
        lens = _lens(path, entry)
        row[: len(lens)] = lens
    scale = _scale(path, contents, unit)
    size = _sizes(path, contents, sizes or {})
    try:
        cameras = make_cameras(
            K=np.stack([entry.K for entry in entries]),
            R=np.stack([entry.R for entry in entries]),
            t=np.stack([entry.t for entry in entries]) * scale,
            size=size,
            dist=dist,
            names=names,
            fisheye=np.array([entry.fisheye for entry in entries]),
        )
    except ValueError as error:
        raise fault(path, None, str(error)) from None
    _check_spread(path, cameras)
    return Calibration(cameras, contents.up, contents.format, contents.unposed)


def choose_views(calibration: Calibration, views: Sequence[str]) -> Calibration:
    """The cameras of the given views, in their order; cameras without a view are left out.

    Args:
        calibration: The rig.
        views: Names of the views, each the name of its camera.

    Raises:
        ValueError: One line that names the views without a camera, and the available cameras.
    """
    names = calibration.cameras.names
    lost = [view for view in views if view not in names]
    if set(lost) & set(calibration.unposed):
        name = next(view for view in lost if view in calibration.unposed)
        raise ValueError(f"camera {name}: {not_posed(calibration.format)}")
    if lost or len(set(views)) != len(views):
        raise ValueError(
            f"views {', '.join(lost or views)}: name each view once, after its camera; the calibration "
            f"({calibration.format}) has {', '.join(names)}"
        )
    return replace(calibration, cameras=calibration.cameras[[names.index(view) for view in views]])


def not_posed(kind: str) -> str:
    """The message for a camera without a pose."""
    ignore = " and ignore the camera (ignore = true)" if kind.startswith("Caliscope") else ""
    return (
        f"was not posed: {kind} gives it no rotation or no translation; calibrate it with the others, or leave out "
        f"its view{ignore}"
    )


def _lens(path: Path, entry: CameraEntry) -> np.ndarray:
    """At most eight coefficients; OpenCV's longer models are accepted if the further ones are zero."""
    if entry.fisheye:
        if len(entry.dist) != FISHEYE_COEFFICIENTS:
            raise camera_fault(
                path,
                entry.name,
                f"is a fisheye lens of {len(entry.dist)} distortion coefficients; give the four of cv2.fisheye (k1, "
                "k2, k3, k4), or leave fisheye out if these are an ordinary lens'",
            )
        return entry.dist
    if len(entry.dist) not in (0, 4, 5, 8, 12, 14) or entry.dist[COEFFICIENTS:].any():
        raise camera_fault(
            path,
            entry.name,
            f"{len(entry.dist)} distortion coefficients; give OpenCV's (k1, k2, p1, p2[, k3[, k4, k5, k6]]), or the "
            "four of a fisheye lens; thin-prism and tilt models are not read, so undistort the images first",
        )
    return entry.dist[:COEFFICIENTS]


def _scale(path: Path, contents: Contents, unit: float | None) -> float:
    if unit is None:
        unit = contents.unit
    if unit is None:
        raise fault(path, None, f"{contents.format} has no scale: {contents.scale_is}")
    # Units from nanometres to kilometres; beyond, squares of lengths overflow.
    if not 1e-9 <= unit <= 1e3:
        raise ValueError(f"unit is {unit}; give metres per unit of the file, 0.001 where it is in millimetres")
    for entry in contents.entries:
        away = float(np.linalg.norm(entry.t)) * unit
        if away > _FARTHEST_CAMERA:
            raise camera_fault(
                path,
                entry.name,
                f"stands {away:.0f} m away from the origin; give unit, the metres per unit of the file: 0.001 "
                "where it is in millimetres",
            )
    return float(unit)


def _sizes(path: Path, contents: Contents, given: Mapping[str, tuple[int, int]]) -> list[tuple[float, float]]:
    names = [entry.name for entry in contents.entries]
    for name in given:
        if name in contents.unposed:
            raise camera_fault(path, name, not_posed(contents.format))
        if name not in names:
            raise camera_fault(path, name, f"sizes names it, but the file has {', '.join(names)}; match the names")
    found = []
    for entry in contents.entries:
        stated, view = entry.size, given.get(entry.name)
        size = view if stated is None else stated
        if size is None:
            raise camera_fault(
                path,
                entry.name,
                f"{contents.format} gives no image size here; give sizes={{{entry.name!r}: (width, height)}}",
            )
        if stated is not None and view is not None and tuple(stated) != tuple(view):
            raise camera_fault(
                path,
                entry.name,
                f"was calibrated at {stated[0]:g} x {stated[1]:g}, but its images are {view[0]} x {view[1]}; "
                "calibrate at the size that is recorded, or resize the images",
            )
        found.append((float(size[0]), float(size[1])))
    return found


def _check_spread(path: Path, cameras: Cameras) -> None:
    spread = np.ptp(cameras.centres, axis=0).max()
    if len(cameras) > 1 and spread < _NARROWEST_RIG:
        raise fault(
            path,
            None,
            f"camera {cameras.names[0]} and all others stand within {spread:.2g} m of each other; give unit, the "
            "metres per unit of the file: 1 where it is in metres",
        )
