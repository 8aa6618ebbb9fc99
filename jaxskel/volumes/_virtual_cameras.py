"""Virtual cameras around a box: a ring that sees all of it."""

import equinox as eqx
import numpy as np
from jaxtyping import Float

from ..cameras import Cameras
from ..synthetic import camera_ring

# Angles (degrees) at which the cameras look down, in turn.
_ELEVATIONS = (3.0, 20.0)
# Distance of the cameras from the middle, in units of the box' largest extent.
_AWAY = 2.0
_MARGIN = 0.05  # m, around the box
# Largest side of an image (px).
_WIDEST = 2000


def virtual_cameras(count: int, lower: Float[np.ndarray, "3"], upper: Float[np.ndarray, "3"], pixel: float) -> Cameras:
    """Cameras at equal angles around a box, in a world with z up.

    Args:
        count: Number of cameras.
        lower: Lower corner of the box (m).
        upper: Upper corner of the box (m).
        pixel: Width of a pixel in the middle of the box (m); wider where images would be too large.
    """
    extent = upper - lower + 2 * _MARGIN
    volume = float(np.hypot(*extent[:2])), float(extent[2])
    radius = _AWAY * max(volume)
    heights = tuple(volume[1] / 2 + radius * np.tan(np.radians(angle)) for angle in _ELEVATIONS)

    def ring(side: int) -> Cameras:
        return camera_ring(count, radius, (side, side), heights, volume)

    # The focal length grows with the image, but for a constant of some pixels.
    wanted = _WIDEST * (radius / pixel) / float(ring(_WIDEST).K[0, 0, 0])
    cameras = ring(min(_WIDEST, int(np.ceil(wanted))))
    # The ring stands around the z axis, on the floor.
    floor = np.array([*(lower + upper)[:2] / 2, lower[2] - _MARGIN])
    return eqx.tree_at(lambda c: c.t, cameras, np.asarray(cameras.t) - np.asarray(cameras.R) @ floor)
