"""What was done to a camera's images after it was calibrated: turned, cropped or padded, scaled.

In this order. Images are turned by quarter turns, then cut out of what was calibrated, or padded to reach beyond it,
and scaled at last. With integers at the centres of pixels, a point ``(u, v)`` of the calibrated image, which has ``w``
by ``h`` px, is in the image at

    turn = 90:   (h - 1 - v, u)        clockwise
    turn = 180:  (w - 1 - u, h - 1 - v)
    turn = 270:  (v, w - 1 - u)
    crop, scale: u' = scale_x (u - x + 0.5) - 0.5, v' = scale_y (v - y + 0.5) - 0.5

A camera that makes these images has other intrinsics and, where they were turned, is turned about its axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from ._cameras import Cameras

TURNS = (0, 90, 180, 270)


@dataclass(frozen=True)
class ImageChange:
    """What was done to images, in this order."""

    turn: int = 0
    """Degrees, clockwise: one of `TURNS`."""
    crop: tuple[float, float] = (0.0, 0.0)
    """Where the left and the upper edge of the image lie in the calibrated one once turned (px of that); negative where
    it was padded there."""
    scale: tuple[float, float] = (1.0, 1.0)
    """Pixels of the image for each calibrated one, across and down."""

    def turned_size(self, calibrated: tuple[float, float]) -> tuple[float, float]:
        """Width and height of the calibrated images once turned (px)."""
        return calibrated if self.turn % 180 == 0 else (calibrated[1], calibrated[0])

    def size_of_all(self, calibrated: tuple[float, float]) -> tuple[float, float]:
        """Width and height of images that show all that was calibrated, and no more (px)."""
        width, height = self.turned_size(calibrated)
        return width * self.scale[0], height * self.scale[1]

    def matrix(self, calibrated: tuple[float, float]) -> Float[np.ndarray, "3 3"]:
        """From points of the calibrated images, of this size, to points of the images (px, homogeneous)."""
        w, h = calibrated
        turned = {
            0: [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
            90: [[0, -1, h - 1], [1, 0, 0], [0, 0, 1]],
            180: [[-1, 0, w - 1], [0, -1, h - 1], [0, 0, 1]],
            270: [[0, 1, 0], [-1, 0, w - 1], [0, 0, 1]],
        }[self.turn]
        (x, y), (across, down) = self.crop, self.scale
        scaled = [[across, 0, across * (0.5 - x) - 0.5], [0, down, down * (0.5 - y) - 0.5], [0, 0, 1]]
        return np.array(scaled, float) @ np.array(turned, float)


def with_images_changed(
    cameras: Cameras,
    changes: Sequence[ImageChange],
    calibrated: Sequence[tuple[float, float]],
    size: Int[np.ndarray, "cams 2"],
) -> Cameras:
    """The cameras that make the changed images: a point is seen where the change moves what the camera saw before.

    Exact, whatever the lens does. Radial distortion is the same in all directions. The tangential one, of normalised
    points x, is ``|x|^2 p + 2 (p . x) x`` with ``p = (p2, p1)``: it turns if p does.

    Args:
        cameras: As they were calibrated.
        changes: What was done to the images of each.
        calibrated: Width and height of the images of each when it was calibrated (px).
        size: Width and height of its images now (px).
    """
    K, R, t, dist = (np.array(a, float) for a in (cameras.K, cameras.R, cameras.t, cameras.dist))
    for c, (change, before) in enumerate(zip(changes, calibrated, strict=True)):
        moved = change.matrix(before) @ K[c]
        # Intrinsics are upper triangular: what a turn puts below the diagonal is a turn of the camera.
        low = moved[1, :2] / np.hypot(*moved[1, :2])
        turn = np.array([[low[1], -low[0], 0.0], [low[0], low[1], 0.0], [0.0, 0.0, 1.0]])
        K[c], R[c], t[c] = np.triu(moved @ turn.T), turn @ R[c], turn @ t[c]
        if not cameras.are_fisheye[c]:  # of these no coefficient is tangential
            dist[c, [3, 2]] = turn[:2, :2] @ dist[c, [3, 2]]
    return replace(cameras, K=K, R=R, t=t, dist=dist, size=np.asarray(size, np.int64))
