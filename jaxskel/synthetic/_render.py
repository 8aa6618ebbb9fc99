"""Exact silhouettes of tapered capsules: a pixel is foreground if the ray of its centre meets a capsule."""

from collections.abc import Callable

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, UInt8

from ..cameras import Cameras, rays
from ..recording import pack_silhouettes


class View(eqx.Module):
    """The viewing rays of all pixels of one camera. Make one with [`make_view`][].

    Attributes:
        centre: Optical centre in the world (m).
        rotation: From world to camera.
        directions: Unit viewing directions in the world, by coordinate; NaN where the lens sees nothing.
        columns: Smallest and largest x / z in camera coordinates that each column of pixels sees.
        rows: Smallest and largest y / z in camera coordinates that each row of pixels sees.
    """

    centre: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "3 3"]
    directions: Float[np.ndarray, "3 h w"]
    columns: Float[np.ndarray, "2 w"]
    rows: Float[np.ndarray, "2 h"]


def make_view(cameras: Cameras, index: int) -> View:
    """Compute the viewing rays of one camera's pixel centres, with its skew and distortion."""
    width, height = (int(n) for n in cameras.size[index])
    v, u = np.mgrid[:height, :width]
    directions = rays(cameras, index, np.stack([u.ravel(), v.ravel()], -1).astype(np.float64))
    rotation = np.asarray(cameras.R[index], np.float64)
    in_camera = directions @ rotation.T
    slopes = (in_camera[:, :2] / in_camera[:, 2:]).reshape(height, width, 2)
    least = np.where(np.isnan(slopes), np.inf, slopes)
    greatest = np.where(np.isnan(slopes), -np.inf, slopes)
    return View(
        centre=cameras.centres[index],
        rotation=rotation,
        directions=np.ascontiguousarray(directions.T).reshape(3, height, width),
        columns=np.stack([least[..., 0].min(0), greatest[..., 0].max(0)]),
        rows=np.stack([least[..., 1].min(1), greatest[..., 1].max(1)]),
    )


def render_view(
    view: View, ends: Float[np.ndarray, "capsules 2 3"], radii: Float[np.ndarray, "capsules 2"]
) -> Bool[np.ndarray, "h w"]:
    """Render the silhouette of one frame in one view.

    Args:
        view: The rays of the camera.
        ends: Centres of the balls at both ends of each capsule in the world (m).
        radii: Their radii (m).

    Returns:
        True where the ray of a pixel centre meets a capsule in front of the camera.
    """
    mask = np.zeros(view.directions.shape[1:], bool)
    from_camera = ends - view.centre
    rectangles = _rectangles(view, from_camera, radii)
    for (top, bottom, left, right), (start, end), (radius, end_radius) in zip(
        rectangles.tolist(), from_camera, radii.tolist(), strict=True
    ):
        if top < bottom and left < right:
            directions = view.directions[:, top:bottom, left:right]
            mask[top:bottom, left:right] |= _meets(directions, start, end - start, radius, end_radius - radius)
    return mask


def render(
    cameras: Cameras,
    ends: Float[np.ndarray, "frames capsules 2 3"],
    radii: Float[np.ndarray, "capsules 2"],
    on_frame: Callable[[int], None] | None = None,
) -> UInt8[np.ndarray, "frames cams h w8"]:
    """Render the silhouettes of all frames in all views, packed as in a `Recording`.

    Args:
        cameras: The rig. Images of different sizes are padded with background to the largest.
        ends: Centres of the balls at both ends of each capsule in the world (m).
        radii: Their radii (m).
        on_frame: Called with the number of frames done after each frame, to show progress.
    """
    views = [make_view(cameras, index) for index in range(len(cameras))]
    width, height = cameras.size.max(0)
    packed = np.zeros((len(ends), len(cameras), height, -(-width // 8)), np.uint8)
    masks = np.zeros((1, len(cameras), height, width), bool)
    for frame in range(len(ends)):
        for index, view in enumerate(views):
            h, w = view.directions.shape[1:]
            masks[0, index, :h, :w] = render_view(view, ends[frame], radii)
        packed[frame] = pack_silhouettes(masks)[0]
        if on_frame is not None:
            on_frame(frame + 1)
    return packed


def _meets(directions: np.ndarray, start: np.ndarray, axis: np.ndarray, radius: float, growth: float) -> np.ndarray:
    """Whether half lines from the origin meet a ball of radius ``radius + s growth`` at ``start + s axis``, s in 0..1.

    The squared distance of the axis point s to a line, minus the squared radius there, is the quadratic
    ``a s^2 + 2 b s + c``: the line meets the capsule if it is at most zero for some s. A half line ends at the camera,
    so only axis points ahead of the camera are considered; balls behind can meet the ray only if they contain the
    camera.

    Args:
        directions: Unit vectors along the lines, with a leading axis of coordinates.
        start: Centre of the first ball (m).
        axis: From there to the centre of the last one (m).
        radius: Radius of the first ball (m).
        growth: By how much that of the last one is larger (m).
    """
    x, y, z = directions
    ahead, advance = (x * a + y * b + z * c for a, b, c in (start, axis))
    aa, ab, bb = float(axis @ axis), float(start @ axis), float(start @ start)
    a, b, c = aa - growth**2, ab - radius * growth, bb - radius**2
    if _reaches_zero(np.array([a]), np.array([b]), np.array([c]), 0.0, 1.0).any():  # the camera is inside
        return ~np.isnan(ahead)
    a, b, c = a - advance * advance, b - ahead * advance, c - ahead * ahead
    first, last = ahead, ahead + advance
    if np.fmin(first, last).min(initial=1.0) > 0.0:
        return _reaches_zero(a, b, c, 0.0, 1.0)
    crossing = -ahead / np.where(advance == 0.0, 1.0, advance)
    from_s = np.where(first < 0.0, np.where(last < 0.0, np.inf, crossing), 0.0)
    to_s = np.where(last < 0.0, np.where(first < 0.0, -np.inf, crossing), 1.0)
    seen = from_s <= to_s
    return seen & _reaches_zero(a, b, c, np.where(seen, from_s, 0.0), np.where(seen, to_s, 0.0))


def _reaches_zero(
    a: np.ndarray, b: np.ndarray, c: np.ndarray, low: np.ndarray | float, high: np.ndarray | float
) -> np.ndarray:
    """Whether ``a s^2 + 2 b s + c <= 0`` for some s from `low` to `high`: at the minimum, or at an end."""
    if a.min(initial=1.0) > 0.0:
        s = np.clip(-b / a, low, high)
        return (a * s + 2 * b) * s + c <= 0
    at_ends = ((a * low + 2 * b) * low + c <= 0) | ((a * high + 2 * b) * high + c <= 0)
    return at_ends | ((a > 0) & (-b > low * a) & (-b < high * a) & (b * b >= a * c))


def _rectangles(view: View, from_camera: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Rectangle of pixels (top, bottom, left, right) for each capsule, outside of which no ray meets it.

    The slopes x / z and y / z of a capsule lie between those of the tangents to its end balls. Comparing them with the
    slopes seen by whole rows and columns of pixels needs no projection, so it is valid for every lens.
    """
    x, y, z = np.moveaxis(from_camera @ view.rotation.T, -1, 0)
    partly_behind = (z - radii < 1e-6).any(-1)
    bounds = []
    for value, seen in ((y, view.rows), (x, view.columns)):
        away = np.hypot(value, z)
        half = np.arcsin(np.minimum(radii / np.maximum(away, 1e-9), 1.0))
        angle = np.arctan2(value, z)
        low, high = np.tan((angle - half).min(-1)), np.tan((angle + half).max(-1))
        # The slack covers rounding. A capsule that crosses the camera's plane has no tangents, so it gets all
        # pixels.
        low = np.where(partly_behind, -np.inf, low - 1e-6)
        high = np.where(partly_behind, np.inf, high + 1e-6)
        touched = (seen[1] >= low[:, None]) & (seen[0] <= high[:, None])
        count = touched.shape[1]
        bounds += [touched.argmax(1), np.where(touched.any(1), count - touched[:, ::-1].argmax(1), 0)]
    return np.stack(bounds, -1)
