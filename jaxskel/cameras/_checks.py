"""Validation of calibrations: each error is one line that names the camera and the remedy."""

from typing import Any

import numpy as np
from jaxtyping import Bool

from ._lens import COEFFICIENTS, FISHEYE_COEFFICIENTS, fisheye_distance

# Cameras of a motion-capture room are within this many metres of the scene; larger values are probably millimetres.
_FARTHEST_CAMERA = 100.0
# Smallest half-angle of fisheye lenses whose image is a whole circle (rad): they see 150 degrees and more.
_NARROWEST_FISHEYE = float(np.radians(75.0))


def floats(name: str, value: Any) -> np.ndarray:
    """Convert an argument to a float64 array."""
    try:
        return np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is not an array of numbers") from None


def check_finite(name: str, array: np.ndarray, labels: tuple[str, ...]) -> None:
    """Refuse NaN and infinity."""
    if not np.isfinite(array).all():
        i = int(np.argwhere(~np.isfinite(array))[0][0])
        raise ValueError(f"camera {labels[i]} (index {i}): {name} holds NaN or infinity: calibrate that camera again")


def image_sizes(size: Any, labels: tuple[str, ...]) -> np.ndarray:
    """Width and height of each camera's images (px)."""
    sizes, n = floats("size", size), len(labels)
    if sizes.shape not in ((2,), (n, 2)):
        raise ValueError(f"size has shape {sizes.shape}: give (width, height) or one pair for each of {n} cameras")
    sizes = np.broadcast_to(sizes, (n, 2))
    whole = ((sizes >= 1) & (sizes <= 65536) & (sizes == np.round(sizes))).all(1)
    if not whole.all():
        i = int(np.argmin(whole))
        raise ValueError(
            f"camera {labels[i]} (index {i}): size {sizes[i].tolist()}: width and height are whole numbers of pixels, "
            "1 to 65536"
        )
    return sizes.astype(np.int64)


def fisheyes(given: Any, n: int) -> Bool[np.ndarray, " cams"]:
    """Mask of the fisheye lenses."""
    found = np.asarray(given)
    if found.dtype != bool or found.shape not in ((), (n,)):
        raise ValueError(f"fisheye: give true or false, for all or for each of {n} cameras")
    return np.array(np.broadcast_to(found, (n,)))


def distortion(dist: Any, labels: tuple[str, ...], fisheye: Bool[np.ndarray, " cams"]) -> np.ndarray:
    """Distortion coefficients of each lens, padded with zeros."""
    n = len(labels)
    full = np.zeros((n, COEFFICIENTS))
    if dist is None:
        return full
    given = floats("dist", dist)
    if given.ndim != 2 or len(given) != n or given.shape[1] not in (0, 4, 5, 8):
        raise ValueError(
            f"dist has shape {given.shape}: give OpenCV's (k1, k2, p1, p2[, k3[, k4, k5, k6]]) for each of {n} "
            "cameras, or the (k1, k2, k3, k4) of a fisheye lens; thin-prism and tilt models are not read"
        )
    full[:, : given.shape[1]] = given
    too_many = fisheye & (full[:, FISHEYE_COEFFICIENTS:] != 0).any(1)
    if too_many.any():
        i = int(np.argmax(too_many))
        raise ValueError(
            f"camera {labels[i]} (index {i}): dist {full[i].tolist()}: a fisheye lens has four coefficients, k1, k2, "
            "k3 and k4 of cv2.fisheye, with zeros behind; if these are an ordinary lens', leave fisheye out"
        )
    return full


def check_one(where: str, K: np.ndarray, R: np.ndarray, t: np.ndarray) -> None:
    """Refuse invalid intrinsic matrices, invalid rotations, and translations that are not in metres."""
    if abs(K[2, 2]) < 1e-12 or np.abs(K[2, :2]).max() > 1e-9 * abs(K[2, 2]) or abs(K[1, 0]) > 1e-6 * abs(K[0, 0]):
        raise ValueError(f"{where}: K is not an upper triangular intrinsic matrix: {K.round(3).tolist()}")
    if K[0, 0] / K[2, 2] <= 0 or K[1, 1] / K[2, 2] <= 0:
        raise ValueError(f"{where}: the focal lengths K[0, 0] and K[1, 1] must be positive: {K.round(3).tolist()}")
    off = np.abs(R @ R.T - np.eye(3)).max()
    if off > 1e-3:
        raise ValueError(
            f"{where}: R is not a rotation, R R^T differs from the identity by {off:.2g}; "
            "give the 3 x 3 matrix from world to camera (a Rodrigues vector goes through cv2.Rodrigues first)"
        )
    if np.linalg.det(R) < 0:
        raise ValueError(f"{where}: R is a mirror (determinant -1), not a rotation; flip one axis of the calibration")
    if np.linalg.norm(t) > _FARTHEST_CAMERA:
        raise ValueError(
            f"{where}: t is {np.linalg.norm(t):.0f} m long; translations are metres, so divide by 1000 if these "
            "are millimetres"
        )


def check_fold(where: str, K: np.ndarray, dist: np.ndarray, limit: float, size: np.ndarray) -> None:
    """Refuse a fisheye lens that shows nothing in most of its image: its coefficients are of another lens model."""
    angle, (width, height) = float(np.arctan(limit)), size.tolist()
    away = fisheye_distance(dist[:FISHEYE_COEFFICIENTS], angle)
    (across, u), (down, v) = (K[0, 0] * away, K[0, 2]), (K[1, 1] * away, K[1, 2])
    is_whole = across < min(u, width - 1 - u) and down < min(v, height - 1 - v)
    if angle < _NARROWEST_FISHEYE and is_whole:
        raise ValueError(
            f"{where}: dist {dist[:FISHEYE_COEFFICIENTS].tolist()}: this fisheye lens folds its image at "
            f"{np.degrees(angle):.0f} degrees to its axis, {max(across, down):.0f} px from its centre; give the k1, "
            "k2, k3, k4 of cv2.fisheye.calibrate, or leave fisheye out if these are an ordinary lens'"
        )
