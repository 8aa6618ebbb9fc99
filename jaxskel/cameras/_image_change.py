"""Changes of a camera's images after its calibration: turned, cropped or padded, scaled, in this order.

Images are turned by quarter turns, then cropped or padded relative to the calibrated image, then scaled. With integers
at the centres of pixels, a point ``(u, v)`` of the calibrated image, which has ``w`` by ``h`` px, moves to

    turn = 90:   (h - 1 - v, u)        clockwise
    turn = 180:  (w - 1 - u, h - 1 - v)
    turn = 270:  (v, w - 1 - u)
    crop, scale: u' = scale_x (u - x + 0.5) - 0.5, v' = scale_y (v - y + 0.5) - 0.5

A camera that matches these images has other intrinsics and, if they were turned, is rotated about its axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from ._cameras import Cameras

TURNS = (0, 90, 180, 270)


@dataclass(frozen=True)
class ImageChange:
    """Change of images: turned, cropped or padded, scaled, in this order.

    Attributes:
        turn: Degrees, clockwise: one of `TURNS`.
        crop: Left and upper edge of the image in the turned calibrated image (px of that); negative where it was
            padded.
        scale: Image pixels per calibrated pixel, across and down.
    """

    turn: int = 0
    crop: tuple[float, float] = (0.0, 0.0)
    scale: tuple[float, float] = (1.0, 1.0)

    def turned_size(self, calibrated: tuple[float, float]) -> tuple[float, float]:
        """Width and height of the calibrated images after turning (px)."""
        return calibrated if self.turn % 180 == 0 else (calibrated[1], calibrated[0])

    def size_of_all(self, calibrated: tuple[float, float]) -> tuple[float, float]:
        """Width and height of images that are neither cropped nor padded (px)."""
        width, height = self.turned_size(calibrated)
        return width * self.scale[0], height * self.scale[1]

    def matrix(self, calibrated: tuple[float, float]) -> Float[np.ndarray, "3 3"]:
        """Homogeneous transform (px) from points of calibrated images of this size to points of the changed images."""
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
    """The cameras that match the changed images: a point is seen where the change moves its old image point.

    Exact for every lens. Radial distortion is the same in all directions. The tangential distortion of normalised
    points x is ``|x|^2 p + 2 (p . x) x`` with ``p = (p2, p1)``: it turns if p does.

    Args:
        cameras: The cameras as calibrated.
        changes: Change of the images of each camera.
        calibrated: Width and height of each camera's images when it was calibrated (px).
        size: Width and height of each camera's images now (px).
    """
    K, R, t, dist = (np.array(a, float) for a in (cameras.K, cameras.R, cameras.t, cameras.dist))
    for c, (change, before) in enumerate(zip(changes, calibrated, strict=True)):
        moved = change.matrix(before) @ K[c]
        # Intrinsics are upper triangular, so what a turn puts below the diagonal becomes a rotation of the camera.
        low = moved[1, :2] / np.hypot(*moved[1, :2])
        turn = np.array([[low[1], -low[0], 0.0], [low[0], low[1], 0.0], [0.0, 0.0, 1.0]])
        K[c], R[c], t[c] = np.triu(moved @ turn.T), turn @ R[c], turn @ t[c]
        if not cameras.are_fisheye[c]:  # fisheye lenses have no tangential coefficients
            dist[c, [3, 2]] = turn[:2, :2] @ dist[c, [3, 2]]
    return replace(cameras, K=K, R=R, t=t, dist=dist, size=np.asarray(size, np.int64))
