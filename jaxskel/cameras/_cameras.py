"""Calibrated cameras: validation, projection and viewing rays, with skew and lens distortion.

Convention (OpenCV): ``x_cam = R x_world + t``; u to the right, v down, and an integer ``(u, v)`` is the centre of
a pixel. Lengths are metres, image coordinates pixels.
"""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ._checks import check_finite, check_fold, check_one, distortion, fisheyes, floats, image_sizes
from ._lens import distorted, max_radius, slopes, undistorted


class Cameras(eqx.Module):
    """A rig of static cameras, stacked along the axis ``cams``. Make one with [`make_cameras`][].

    Attributes:
        K: Intrinsics (px), with skew at ``K[:, 0, 1]``.
        R: Rotation from world to camera.
        t: Translation of ``x_cam = R x_world + t`` (m).
        dist: OpenCV's k1, k2, p1, p2, k3, k4, k5, k6; for a fisheye lens k1, k2, k3, k4 of `cv2.fisheye`, then zeros.
        max_radius: Undistorted radius (tangent of the angle to the axis) up to which the distortion is one-to-one;
            below that of 90 degrees for a fisheye lens.
        size: Width and height of each image (px).
        fisheye: Mask of the lenses with the model of `cv2.fisheye`; None if there are none, so that such rigs skip this
            model.
    """

    K: Float[Array | np.ndarray, "cams 3 3"]
    R: Float[Array | np.ndarray, "cams 3 3"]
    t: Float[Array | np.ndarray, "cams 3"]
    dist: Float[Array | np.ndarray, "cams 8"]
    max_radius: Float[Array | np.ndarray, " cams"]
    size: Int[np.ndarray, "cams 2"]
    names: tuple[str, ...] = eqx.field(static=True)
    fisheye: Bool[Array | np.ndarray, " cams"] | None = None

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
            fisheye=_some(self.are_fisheye[chosen]),
        )

    @property
    def are_fisheye(self) -> Bool[np.ndarray, " cams"]:
        """Mask of the lenses with the model of `cv2.fisheye`."""
        return np.zeros(len(self), bool) if self.fisheye is None else np.asarray(self.fisheye)

    @property
    def bent(self) -> Bool[np.ndarray, " cams"]:
        """Mask of the lenses that do not image straight lines as straight lines."""
        return (np.asarray(self.dist) != 0).any(1) | self.are_fisheye

    @property
    def centres(self) -> Float[np.ndarray, "cams 3"]:
        """Optical centres in the world (m)."""
        return -np.einsum("cji,cj->ci", np.asarray(self.R), np.asarray(self.t))

    def rotated(self, rotation: Float[np.ndarray, "3 3"]) -> "Cameras":
        """The same cameras in a world whose points are ``rotation @ x``."""
        return eqx.tree_at(lambda c: c.R, self, np.asarray(self.R) @ rotation.T)

    def scaled(self, factor: float) -> "Cameras":
        """The same cameras in a world whose points are ``factor * x``."""
        return self if factor == 1 else eqx.tree_at(lambda c: c.t, self, factor * np.asarray(self.t))

    def reduced(self, steps: Int[np.ndarray, " cams"]) -> "Cameras":
        """The same cameras with images whose pixels are `steps` times as wide; a part of one counts as whole."""
        # The centre of the first pixel, of either size, is (0, 0).
        shrink = np.array([[[1 / s, 0, (1 / s - 1) / 2], [0, 1 / s, (1 / s - 1) / 2], [0, 0, 1]] for s in steps])
        size = -(-self.size // np.asarray(steps)[:, None])
        return eqx.tree_at(lambda c: (c.K, c.size), self, (shrink @ np.asarray(self.K), size))


def make_cameras(
    K: Any,
    R: Any,
    t: Any,
    size: Any,
    dist: Any = None,
    names: Sequence[str] | None = None,
    fisheye: Any = False,
) -> Cameras:
    """Check a calibration and build `Cameras` from it.

    Args:
        K: Intrinsics, ``(cams, 3, 3)`` (px).
        R: Rotations from world to camera, ``(cams, 3, 3)``.
        t: Translations, ``(cams, 3)`` (m).
        size: Width and height, ``(2,)`` for all cameras or ``(cams, 2)`` (px).
        dist: OpenCV distortion, ``(cams, 4)``, ``(cams, 5)`` or ``(cams, 8)``; none by default.
        names: One name per camera; ``cam0``, ``cam1``, ... by default.
        fisheye: Whether the lens model is that of ``cv2.fisheye``, for all cameras or each. The first four numbers of
            its row of `dist` are then k1, k2, k3, k4, and the others are zero. The skew is ``K[0, 1]``, whereas
            OpenCV's functions take ``alpha = K[0, 1] / K[0, 0]``. Such a camera sees only points in front of it, at
            less than 90 degrees to its axis.

    Raises:
        ValueError: The calibration is invalid; one line names the camera, the field and the remedy.
    """
    K, R, t = (floats(name, value) for name, value in (("K", K), ("R", R), ("t", t)))
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
    sizes = image_sizes(size, labels)
    wide = fisheyes(fisheye, n)
    full = distortion(dist, labels, wide)
    for name, array in (("K", K), ("R", R), ("t", t), ("dist", full)):
        check_finite(name, array, labels)
    for i, label in enumerate(labels):
        check_one(f"camera {label} (index {i})", K[i], R[i], t[i])
    K, limits = K / K[:, 2:, 2:], max_radius(full, wide)
    for i in np.flatnonzero(wide):
        check_fold(f"camera {labels[i]} (index {i})", K[i], full[i], float(limits[i]), sizes[i])
    return Cameras(K=K, R=R, t=t, dist=full, max_radius=limits, size=sizes, names=labels, fisheye=_some(wide))


def _some(fisheye: Bool[np.ndarray, " cams"]) -> Bool[np.ndarray, " cams"] | None:
    return fisheye if fisheye.any() else None


def project(
    cameras: Cameras, points: Float[Array | np.ndarray, "n 3"]
) -> tuple[
    Float[Array | np.ndarray, "cams n"],
    Float[Array | np.ndarray, "cams n"],
    Float[Array | np.ndarray, "cams n"],
]:
    """Project world points into every camera.

    Works on NumPy arrays (float64, as the carving tables need) and on JAX arrays (differentiable).

    Args:
        cameras: The rig.
        points: World coordinates (m).

    Returns:
        u and v (px) and the depth along the optical axis (m). u and v are NaN where a camera cannot see the point:
        behind it, or beyond the radius at which its distortion folds back.

    Raises:
        ValueError: The points have another shape.
    """
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"points: have shape {points.shape}; give (points, 3) world coordinates (m)")
    right, low, depth = in_cameras(cameras, points)
    return *on_images(cameras, right, low, depth), depth


def in_cameras(cameras: Cameras, points: Float[Array | np.ndarray, "n 3"]) -> tuple[Any, Any, Any]:
    """World points in the coordinates of every camera (m): right, down, and along the optical axis, cams x n each."""
    # Component by component, because a matrix product would leave triples to be split into long arrays.
    right, low, depth = (
        sum(cameras.R[:, row, axis, None] * points[None, :, axis] for axis in range(3)) + cameras.t[:, row, None]
        for row in range(3)
    )
    return right, low, depth


def on_images(cameras: Cameras, right: Any, low: Any, depth: Any) -> tuple[Any, Any]:
    """Project points in camera coordinates (m, cams x n) to u and v (px), as `project` does."""
    xp = depth.__array_namespace__()
    in_front = depth > 1e-6
    safe = xp.where(in_front, depth, 1.0)
    x, y = right / safe, low / safe
    inside = in_front & (x * x + y * y < cameras.max_radius[:, None] ** 2)
    # Outside the one-to-one range the polynomial may overflow; its value there is never used.
    x, y = xp.where(inside, x, 0.0), xp.where(inside, y, 0.0)
    xd, yd = distorted(cameras.dist[:, :, None], _by_point(cameras.fisheye), x, y)
    K = cameras.K[:, :, :, None]
    u = K[:, 0, 0] * xd + K[:, 0, 1] * yd + K[:, 0, 2]
    v = K[:, 1, 1] * yd + K[:, 1, 2]
    return xp.where(inside, u, xp.nan), xp.where(inside, v, xp.nan)


def lens_slopes(cameras: Cameras, x: Any, y: Any) -> tuple[Any, Any, Any, Any]:
    """Derivatives of u by x and y, then of v by x and y (px), with x and y in units of the depth, cams x n."""
    along_x, across, along_y = slopes(cameras.dist, _by_point(cameras.fisheye), x, y)
    K = cameras.K[:, :, :, None]
    return (
        K[:, 0, 0] * along_x + K[:, 0, 1] * across,
        K[:, 0, 0] * across + K[:, 0, 1] * along_y,
        K[:, 1, 1] * across,
        K[:, 1, 1] * along_y,
    )


def apparent_depth(cameras: Cameras, right: Any, low: Any, depth: Any) -> Any:
    """Apparent depth (m, cams x n): a length at a point spans about focal length times length / depth pixels.

    For an ordinary lens, which images planes as planes, this is the depth along the axis. A fisheye lens images angles,
    so for it this is the distance from the optical centre.
    """
    if cameras.fisheye is None:
        return depth
    xp = depth.__array_namespace__()
    # The root has no derivative at zero, which is the optical centre itself and is never seen.
    away = xp.sqrt(xp.maximum(right * right + low * low + depth * depth, 1e-12))
    return xp.where(_by_point(cameras.fisheye), away, depth)


def _by_point(fisheye: Any) -> Any:
    """Mask of the fisheye lenses, with an axis for points."""
    return None if fisheye is None else fisheye[:, None]


def rays(
    cameras: Cameras, index: int | np.integer | Int[np.ndarray, " n"], uv: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n 3"]:
    """Unit viewing directions, in the world, of image points (px): the inverse of [`project`][].

    The points are those of one camera, or `index` gives the camera of each. NaN for image points beyond the one-to-one
    range of the distortion.
    """
    R, directions = np.asarray(cameras.R)[index], rays_in_camera(cameras, index, uv)
    return directions @ R if R.ndim == 2 else np.einsum("ni,nij->nj", directions, R)


def rays_in_camera(
    cameras: Cameras, index: int | np.integer | Int[np.ndarray, " n"], uv: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n 3"]:
    """As `rays`, but unit directions in the camera's frame of reference: extrinsics are not used."""
    K, dist, limits = (np.asarray(a)[index] for a in (cameras.K, cameras.dist, cameras.max_radius))
    yd = (uv[:, 1] - K[..., 1, 2]) / K[..., 1, 1]
    xd = (uv[:, 0] - K[..., 0, 2] - K[..., 0, 1] * yd) / K[..., 0, 0]
    x, y = undistorted(dist, cameras.are_fisheye[index], limits, xd, yd)
    return np.stack([x, y, np.ones_like(x)], -1) / np.sqrt(x * x + y * y + 1)[:, None]
