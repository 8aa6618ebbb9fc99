"""The up direction of the world, estimated from the cameras, which are usually mounted upright."""

import numpy as np
from jaxtyping import Float, Int

from ._cameras import Cameras


def upright(cameras: Cameras, turns: Int[np.ndarray, " cams"] | None = None) -> Float[np.ndarray, " 3"]:
    """Mean of the directions, in the world, that point up in the cameras' images.

    Image rows count downwards, so up in an image is the negative y axis of its camera. The length measures how
    well the cameras agree: 1 if all are mounted alike and look level, less if some are tilted or turned.

    Args:
        cameras: The rig.
        turns: Rotation of the images after the calibration (degrees, clockwise); up is taken from the images before it.
    """
    R, angles = np.asarray(cameras.R), np.radians(0 if turns is None else turns)[..., None]
    return (np.sin(angles) * R[:, 0] - np.cos(angles) * R[:, 1]).mean(0)
