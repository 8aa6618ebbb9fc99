"""Which way is up, as the cameras themselves say it: people mount them upright."""

import numpy as np
from jaxtyping import Float, Int

from ._cameras import Cameras


def upright(cameras: Cameras, turns: Int[np.ndarray, " cams"] | None = None) -> Float[np.ndarray, " 3"]:
    """Mean of the directions, in the world, that are up in the cameras' images.

    Image rows count downwards, so up in an image is the negative y axis of its camera. The length tells how well the
    cameras agree: 1 where all are mounted alike and look level, less where some are tilted or turned.

    Args:
        cameras: The rig.
        turns: By how much the images were turned after the calibration (degrees, clockwise): up is then what it was
            before.
    """
    R, angles = np.asarray(cameras.R), np.radians(0 if turns is None else turns)[..., None]
    return (np.sin(angles) * R[:, 0] - np.cos(angles) * R[:, 1]).mean(0)
