"""OpenCV's two lens models: from tangents of a viewing direction to those of its image, and back.

The ordinary one (rational and tangential) and that of `cv2.fisheye` (J. Kannala and S. Brandt: A Generic Camera Model
and Calibration Method for Conventional, Wide-Angle, and Fish-Eye Lenses, PAMI 2006): a direction at angle a to the axis
is imaged ``a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8)`` away from the centre. The model of each camera is data, so that
one program serves rigs of both; a rig without fisheye lenses has None there and skips the fisheye model.
"""

from typing import Any

import numpy as np
from jaxtyping import Bool, Float

COEFFICIENTS = 8
"""Coefficients stored per lens: k1, k2, p1, p2, k3, k4, k5, k6, or k1, k2, k3, k4 of a fisheye lens and zeros."""
FISHEYE_COEFFICIENTS = 4
# Squared tangents below which angle over tangent is computed as a series: otherwise its derivative would be the
# difference of two nearly equal numbers.
_NEAR_AXIS = 0.01
# Highest power of that series; the next term of its derivative would be 5e-17.
_TERMS = 8
# Directions with a larger tangent count as perpendicular to the axis and are not seen.
_WIDEST = 1e6
# Bisection steps, after which a bracket cannot be halved any more in double precision.
_MOST_STEPS = 64


def distorted(dist: Any, fisheye: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Distort tangents; all arguments broadcast, except that the second axis of `dist` holds the coefficients."""
    if fisheye is None:
        return _distorted(dist, x, y)
    xp, (stretch, _) = x.__array_namespace__(), _fisheye_radial(dist, fisheye, x * x + y * y)
    # The unused model is evaluated at zero, where value and derivative are always finite.
    u, v = _distorted(dist, xp.where(fisheye, 0.0, x), xp.where(fisheye, 0.0, y))
    return xp.where(fisheye, x * stretch, u), xp.where(fisheye, y * stretch, v)


def _distorted(dist: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """OpenCV's rational and tangential lens model."""
    if isinstance(dist, np.ndarray) and not dist.any():  # rendered or undistorted images: nothing would change
        return x, y
    k1, k2, p1, p2, k3, k4, k5, k6 = (dist[:, i] for i in range(COEFFICIENTS))
    r2 = x * x + y * y
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return (
        x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    )


def slopes(dist: Any, fisheye: Any, x: Any, y: Any) -> tuple[Any, Any, Any]:
    """Derivatives of `distorted`: of the first number by x, of the first by y and the second by x, of the second by y.

    Here the coefficients have no axis for points. Written by hand, because JAX's derivative of the lens model takes ten
    times as long.
    """
    numbers = tuple(dist[:, i, None] for i in range(COEFFICIENTS))
    _, _, p1, p2, *_ = numbers
    r2 = x * x + y * y
    if fisheye is None:
        radial, growth = _radial(numbers, r2)
    else:
        xp = x.__array_namespace__()
        p1, p2 = xp.where(fisheye, 0.0, p1), xp.where(fisheye, 0.0, p2)
        own, other = _fisheye_radial(dist[:, :, None], fisheye, r2), _radial(numbers, xp.where(fisheye, 0.0, r2))
        radial, growth = (xp.where(fisheye, a, b) for a, b in zip(own, other, strict=True))
    along_x = radial + growth * x * x + 2 * p1 * y + 6 * p2 * x
    across = growth * x * y + 2 * p1 * x + 2 * p2 * y
    along_y = radial + growth * y * y + 6 * p1 * y + 2 * p2 * x
    return along_x, across, along_y


def _radial(numbers: tuple[Any, ...], r2: Any) -> tuple[Any, Any]:
    """Factor by which an ordinary lens stretches tangents with square r2, and twice its derivative by r2."""
    k1, k2, _, _, k3, k4, k5, k6 = numbers
    below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / below
    growth = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3) - radial * (k4 + r2 * (2 * k5 + r2 * 3 * k6))) / below
    return radial, growth


def _fisheye_radial(dist: Any, fisheye: Any, r2: Any) -> tuple[Any, Any]:
    """Factor by which a fisheye lens stretches tangents with square r2, and twice its derivative by r2."""
    xp = r2.__array_namespace__()
    k1, k2, k3, k4 = (dist[:, i] for i in range(FISHEYE_COEFFICIENTS))
    r2 = xp.where(fisheye, r2, 0.0)
    near = r2 < _NEAR_AXIS
    small, large = xp.where(near, r2, 0.0), xp.where(near, 1.0, r2)
    # The angle over its tangent, and its derivative by the square of the tangent.
    series = its_slope = 0 * small
    for n in range(_TERMS, -1, -1):
        its_slope = series + small * its_slope
        series = (-1) ** n / (2 * n + 1) + small * series
    root = xp.sqrt(large)
    ratio = xp.where(near, series, xp.atan(root) / root)
    slope = xp.where(near, its_slope, (1 / (1 + large) - xp.atan(root) / root) / (2 * large))
    squared = r2 * ratio * ratio
    stretch = 1 + squared * (k1 + squared * (k2 + squared * (k3 + squared * k4)))
    stretches = k1 + squared * (2 * k2 + squared * (3 * k3 + squared * 4 * k4))
    return ratio * stretch, 2 * (slope * stretch + ratio * ratio * stretches / (1 + r2))


def max_radius(dist: Float[np.ndarray, "cams 8"], fisheye: Bool[np.ndarray, " cams"]) -> Float[np.ndarray, " cams"]:
    """Smallest tangent at which the image stops moving outwards; beyond it, rays fold back into the image."""
    return np.array([_fisheye_fold(k) if wide else _fold(k) for k, wide in zip(dist, fisheye, strict=True)])


def _fold(dist: Float[np.ndarray, "8"]) -> float:
    k1, k2, _, _, k3, k4, k5, k6 = dist
    radius = np.linspace(0.0, 20.0, 20001)
    r2 = radius**2
    below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    with np.errstate(divide="ignore", invalid="ignore"):
        bent = radius * (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / below
    bad = (np.diff(bent) <= 0) | (below[1:] <= 0) | ~np.isfinite(bent[1:])
    return float(radius[int(np.argmax(bad))]) if bad.any() else np.inf


def _fisheye_fold(dist: Float[np.ndarray, "8"]) -> float:
    k, angles = dist[:FISHEYE_COEFFICIENTS], np.linspace(0.0, np.pi / 2, 4097)
    with np.errstate(over="ignore", invalid="ignore"):
        bad = ~(_fisheye_slope(k, angles) > 0)
        if not bad.any():
            return _WIDEST
        low, high = angles[int(np.argmax(bad)) - 1], angles[int(np.argmax(bad))]
        for _ in range(_MOST_STEPS):
            middle = (low + high) / 2
            low, high = (middle, high) if _fisheye_slope(k, middle) > 0 else (low, middle)
    return min(float(np.tan(low)), _WIDEST)


def undistorted(
    dist: np.ndarray, fisheye: Any, max_radius: Any, xd: Float[np.ndarray, " points"], yd: Float[np.ndarray, " points"]
) -> tuple[Float[np.ndarray, " points"], Float[np.ndarray, " points"]]:
    """The tangents that a lens, or one lens per point, distorts to some points; NaN outside its one-to-one range."""
    if fisheye is None or not np.any(fisheye):
        return _undone(dist, max_radius, xd, yd)
    lenses, limits = np.broadcast_to(dist, (len(xd), COEFFICIENTS)), np.broadcast_to(max_radius, xd.shape)
    x, y = np.empty(xd.shape), np.empty(xd.shape)
    wide = np.broadcast_to(fisheye, xd.shape)
    for own, undone in ((wide, _fisheye_undone), (~wide, _undone)):
        x[own], y[own] = undone(lenses[own], limits[own], xd[own], yd[own])
    return x, y


def _undone(dist: np.ndarray, max_radius: Any, xd: np.ndarray, yd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
        lost = ~(np.hypot(fx - xd, fy - yd) < 1e-7) | ~(np.hypot(x, y) < max_radius)
        x, y = np.where(lost, np.nan, x), np.where(lost, np.nan, y)
    return x, y


def _at(dist: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distorted points of one lens, or of one lens per point."""
    lenses = np.atleast_2d(dist)[:, :, None]
    xd, yd = _distorted(lenses, x.reshape(len(lenses), -1), y.reshape(len(lenses), -1))
    return xd.reshape(-1), yd.reshape(-1)


def _fisheye_undone(
    dist: np.ndarray, max_radius: np.ndarray, xd: np.ndarray, yd: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Newton's method for the angle, bracketed by a lower and an upper bound, so that it always converges."""
    k = dist[:, :FISHEYE_COEFFICIENTS]
    away, low, high = np.hypot(xd, yd), np.zeros(xd.shape), np.arctan(max_radius)
    lost = ~(away < fisheye_distance(k, high))
    goal = np.where(lost, 0.0, away)
    angle = np.minimum(goal, high)
    for _ in range(_MOST_STEPS):
        off = fisheye_distance(k, angle) - goal
        low, high = np.where(off < 0, angle, low), np.where(off > 0, angle, high)
        with np.errstate(divide="ignore", invalid="ignore"):  # at the limit of the lens the slope may vanish
            newton = angle - off / _fisheye_slope(k, angle)
        following = np.where(off == 0, angle, np.where((newton >= low) & (newton <= high), newton, (low + high) / 2))
        if (following == angle).all():
            break
        angle = following
    with np.errstate(divide="ignore", invalid="ignore"):
        stretch = np.where(away > 0, np.tan(angle) / away, 1.0)
    stretch = np.where(lost, np.nan, stretch)
    return xd * stretch, yd * stretch


def fisheye_distance(k: np.ndarray, angle: Any) -> Any:
    """Distance from the image centre (focal lengths) at which a fisheye lens images an angle to its axis (rad)."""
    t = angle**2
    return angle * (1 + t * (k[..., 0] + t * (k[..., 1] + t * (k[..., 2] + t * k[..., 3]))))


def _fisheye_slope(k: np.ndarray, angle: Any) -> Any:
    """The derivative of `fisheye_distance` by the angle."""
    t = angle**2
    return 1 + t * (3 * k[..., 0] + t * (5 * k[..., 1] + t * (7 * k[..., 2] + t * 9 * k[..., 3])))
