"""Calibrated cameras: validation at the door, projection with skew and lens distortion.

Convention (OpenCV): ``x_cam = R x_world + t``; u to the right, v down, and an integer ``(u, v)`` is the centre of
a pixel. Lengths are metres, image coordinates pixels.
"""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Int

_N_DIST = 8
# A camera of a motion-capture room stands within this many metres of what it sees; farther means millimetres.
_FARTHEST_CAMERA = 100.0


class Cameras(eqx.Module):
    """A rig of static cameras, stacked along the axis ``cams``. Make one with [`make_cameras`][]."""

    K: Float[Array | np.ndarray, "cams 3 3"]
    """Intrinsics (px), with skew at ``K[:, 0, 1]``."""
    R: Float[Array | np.ndarray, "cams 3 3"]
    """Rotation from world to camera."""
    t: Float[Array | np.ndarray, "cams 3"]
    """Translation of ``x_cam = R x_world + t`` (m)."""
    dist: Float[Array | np.ndarray, "cams 8"]
    """OpenCV's k1, k2, p1, p2, k3, k4, k5, k6."""
    max_radius: Float[Array | np.ndarray, " cams"]
    """Undistorted radius (tangent of the angle to the axis) up to which the distortion is one-to-one."""
    size: Int[np.ndarray, "cams 2"]
    """Width and height of each image (px)."""
    names: tuple[str, ...] = eqx.field(static=True)

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, index: slice | Sequence[int] | np.ndarray) -> "Cameras":
        """Choose cameras by a slice or a list of indices."""
        chosen = np.arange(len(self))[index if isinstance(index, slice) else np.asarray(index, int)]
        return Cameras(
            K=self.K[chosen],
            R=self.R[chosen],
            t=self.t[chosen],
            dist=self.dist[chosen],
            max_radius=self.max_radius[chosen],
            size=self.size[chosen],
            names=tuple(self.names[i] for i in chosen),
        )

    @property
    def centres(self) -> Float[np.ndarray, "cams 3"]:
        """Optical centres in the world (m)."""
        return -np.einsum("cji,cj->ci", np.asarray(self.R), np.asarray(self.t))

    def rotated(self, rotation: Float[np.ndarray, "3 3"]) -> "Cameras":
        """The same cameras in a world whose points are ``rotation @ x``."""
        return eqx.tree_at(lambda c: c.R, self, np.asarray(self.R) @ rotation.T)


def make_cameras(K: Any, R: Any, t: Any, size: Any, dist: Any = None, names: Sequence[str] | None = None) -> Cameras:
    """Check a calibration and build `Cameras` from it.

    Args:
        K: Intrinsics, ``(cams, 3, 3)`` (px).
        R: Rotations from world to camera, ``(cams, 3, 3)``.
        t: Translations, ``(cams, 3)`` (m).
        size: Width and height, ``(2,)`` for all cameras or ``(cams, 2)`` (px).
        dist: OpenCV distortion, ``(cams, 4)``, ``(cams, 5)`` or ``(cams, 8)``; none by default.
        names: One name a camera; ``cam0``, ``cam1``, ... by default.

    Raises:
        ValueError: One line that names the camera, the field and how to mend it.
    """
    K, R, t = (_floats(name, value) for name, value in (("K", K), ("R", R), ("t", t)))
    if K.ndim != 3 or K.shape[1:] != (3, 3) or len(K) == 0:
        raise ValueError(f"K has shape {K.shape}: give one 3 x 3 matrix a camera, (cams, 3, 3)")
    n = len(K)
    labels = tuple(names) if names is not None else tuple(f"cam{i}" for i in range(n))
    if len(labels) != n or len(set(labels)) != n:
        raise ValueError(f"names: {n} different camera names are needed, not {labels}")
    if R.shape != (n, 3, 3):
        raise ValueError(f"R has shape {R.shape} but K holds {n} cameras: give (cams, 3, 3) rotations")
    if t.shape not in ((n, 3), (n, 3, 1)):
        raise ValueError(f"t has shape {t.shape} but K holds {n} cameras: give (cams, 3) translations")
    t = t.reshape(n, 3)
    sizes = _sizes(size, labels)
    full = _distortion(dist, n)
    for name, array in (("K", K), ("R", R), ("t", t), ("dist", full)):
        _check_finite(name, array, labels)
    for i, label in enumerate(labels):
        _check_one(f"camera {label} (index {i})", K[i], R[i], t[i])
    return Cameras(K=K / K[:, 2:, 2:], R=R, t=t, dist=full, max_radius=_max_radius(full), size=sizes, names=labels)


def _floats(name: str, value: Any) -> np.ndarray:
    try:
        return np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is not an array of numbers") from None


def _check_finite(name: str, array: np.ndarray, labels: tuple[str, ...]) -> None:
    if not np.isfinite(array).all():
        i = int(np.argwhere(~np.isfinite(array))[0][0])
        raise ValueError(f"camera {labels[i]} (index {i}): {name} holds NaN or infinity: calibrate that camera again")


def _sizes(size: Any, labels: tuple[str, ...]) -> np.ndarray:
    sizes, n = _floats("size", size), len(labels)
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


def _distortion(dist: Any, n: int) -> np.ndarray:
    full = np.zeros((n, _N_DIST))
    if dist is None:
        return full
    given = _floats("dist", dist)
    if given.ndim != 2 or len(given) != n or given.shape[1] not in (0, 4, 5, 8):
        raise ValueError(
            f"dist has shape {given.shape}: give OpenCV's (k1, k2, p1, p2[, k3[, k4, k5, k6]]) for each of {n} "
            "cameras; fisheye, thin-prism and tilt models are not read"
        )
    full[:, : given.shape[1]] = given
    return full


def _check_one(where: str, K: np.ndarray, R: np.ndarray, t: np.ndarray) -> None:
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


def _max_radius(dist: np.ndarray) -> np.ndarray:
    """First radius at which the radial distortion stops growing; beyond it, rays fold back into the image."""
    radius = np.linspace(0.0, 20.0, 20001)
    limits = np.full(len(dist), np.inf)
    for i, (k1, k2, _, _, k3, k4, k5, k6) in enumerate(dist):
        r2 = radius**2
        below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        with np.errstate(divide="ignore", invalid="ignore"):
            distorted = radius * (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / below
        bad = (np.diff(distorted) <= 0) | (below[1:] <= 0) | ~np.isfinite(distorted[1:])
        if bad.any():
            limits[i] = radius[int(np.argmax(bad))]
    return limits


def project(
    cameras: Cameras, points: Float[Array | np.ndarray, "n 3"]
) -> tuple[
    Float[Array | np.ndarray, "cams n"],
    Float[Array | np.ndarray, "cams n"],
    Float[Array | np.ndarray, "cams n"],
]:
    """Project world points into every camera.

    Works on NumPy arrays (float64, as the carving tables need) and on JAX arrays (differentiable) alike.

    Args:
        cameras: The rig.
        points: World coordinates (m).

    Returns:
        u and v (px) and the depth along the optical axis (m). u and v are NaN where a camera cannot see the point:
        behind it, or beyond the radius at which its distortion folds back.
    """
    right, low, depth = in_cameras(cameras, points)
    return *on_images(cameras, right, low, depth), depth


def in_cameras(cameras: Cameras, points: Float[Array | np.ndarray, "n 3"]) -> tuple[Any, Any, Any]:
    """World points in the frame of every camera (m): to the right, down, and along the optical axis, cams x n each."""
    # Component by component: long rows of numbers, where a product of matrices would leave triples to pick apart.
    right, low, depth = (
        sum(cameras.R[:, row, axis, None] * points[None, :, axis] for axis in range(3)) + cameras.t[:, row, None]
        for row in range(3)
    )
    return right, low, depth


def on_images(cameras: Cameras, right: Any, low: Any, depth: Any) -> tuple[Any, Any]:
    """Where points in the cameras' frames (m, cams x n) are seen, as `project` gives it (px)."""
    xp = depth.__array_namespace__()
    in_front = depth > 1e-6
    safe = xp.where(in_front, depth, 1.0)
    x, y = right / safe, low / safe
    inside = in_front & (x * x + y * y < cameras.max_radius[:, None] ** 2)
    # Outside the one-to-one range the polynomial may overflow; its value there is never used.
    xd, yd = _distort(cameras.dist[:, :, None], xp.where(inside, x, 0.0), xp.where(inside, y, 0.0))
    K = cameras.K[:, :, :, None]
    u = K[:, 0, 0] * xd + K[:, 0, 1] * yd + K[:, 0, 2]
    v = K[:, 1, 1] * yd + K[:, 1, 2]
    return xp.where(inside, u, xp.nan), xp.where(inside, v, xp.nan)


def lens_slopes(cameras: Cameras, x: Any, y: Any) -> tuple[Any, Any, Any, Any]:
    """How u moves with x and y, and how v does (px), where x and y are in units of the depth, cams x n.

    By hand, because the derivative that JAX makes of the lens model takes ten times as long.
    """
    k1, k2, p1, p2, k3, k4, k5, k6 = (cameras.dist[:, i, None] for i in range(_N_DIST))
    r2 = x * x + y * y
    below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / below
    growth = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3) - radial * (k4 + r2 * (2 * k5 + r2 * 3 * k6))) / below
    along_x = radial + growth * x * x + 2 * p1 * y + 6 * p2 * x
    across = growth * x * y + 2 * p1 * x + 2 * p2 * y
    along_y = radial + growth * y * y + 6 * p1 * y + 2 * p2 * x
    K = cameras.K[:, :, :, None]
    return (
        K[:, 0, 0] * along_x + K[:, 0, 1] * across,
        K[:, 0, 0] * across + K[:, 0, 1] * along_y,
        K[:, 1, 1] * across,
        K[:, 1, 1] * along_y,
    )


def _distort(dist: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """OpenCV's rational and tangential lens model on normalised coordinates; `dist` is (cams, 8, 1)."""
    k1, k2, p1, p2, k3, k4, k5, k6 = (dist[:, i] for i in range(_N_DIST))
    r2 = x * x + y * y
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return (
        x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    )


def rays(
    cameras: Cameras, index: int | np.integer | Int[np.ndarray, " n"], uv: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n 3"]:
    """Unit viewing directions in the world of image points (px): the inverse of [`project`][].

    The points are those of one camera, or each is of the camera that `index` says. NaN where no direction is seen at
    that point, because it lies beyond the one-to-one range of the distortion.
    """
    R, directions = np.asarray(cameras.R)[index], rays_in_camera(cameras, index, uv)
    return directions @ R if R.ndim == 2 else np.einsum("ni,nij->nj", directions, R)


def rays_in_camera(
    cameras: Cameras, index: int | np.integer | Int[np.ndarray, " n"], uv: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n 3"]:
    """The same in the frame of reference of the camera: extrinsics are not used."""
    K, dist = (np.asarray(a)[index] for a in (cameras.K, cameras.dist))
    yd = (uv[:, 1] - K[..., 1, 2]) / K[..., 1, 1]
    xd = (uv[:, 0] - K[..., 0, 2] - K[..., 0, 1] * yd) / K[..., 0, 0]
    x, y = xd, yd
    if dist.any():
        # Newton's method with a numerical 2 x 2 Jacobian: the usual fixed point iteration diverges on wide lenses.
        for _ in range(20):
            (fx, fy), step = _at(dist, x, y), 1e-6
            (ax, ay), (bx, by) = _at(dist, x + step, y), _at(dist, x, y + step)
            a, b, c, d = (ax - fx) / step, (bx - fx) / step, (ay - fy) / step, (by - fy) / step
            det = np.where(np.abs(a * d - b * c) > 1e-9, a * d - b * c, 1.0)
            ex, ey = xd - fx, yd - fy
            x, y = x + (d * ex - b * ey) / det, y + (a * ey - c * ex) / det
        fx, fy = _at(dist, x, y)
        lost = ~(np.hypot(fx - xd, fy - yd) < 1e-7) | ~(np.hypot(x, y) < cameras.max_radius[index])
        x, y = np.where(lost, np.nan, x), np.where(lost, np.nan, y)
    return np.stack([x, y, np.ones_like(x)], -1) / np.sqrt(x * x + y * y + 1)[:, None]


def _at(dist: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distorted points of one lens, or of one lens each."""
    lenses = np.atleast_2d(dist)[:, :, None]
    xd, yd = _distort(lenses, x.reshape(len(lenses), -1), y.reshape(len(lenses), -1))
    return xd.reshape(-1), yd.reshape(-1)
