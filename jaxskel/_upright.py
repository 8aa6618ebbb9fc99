"""Which way is up, as the cameras themselves say it: people mount them upright."""

import numpy as np
from jaxtyping import Float

from ._camera import Cameras


def upright(cameras: Cameras) -> Float[np.ndarray, " 3"]:
    """Mean of the directions, in the world, that are up in the cameras' images.

    Image rows count downwards, so up in an image is the negative y axis of its camera. The length tells how well the
    cameras agree: 1 where all are mounted alike and look level, less where some are tilted or turned.
    """
    return -np.asarray(cameras.R)[:, 1].mean(0)
