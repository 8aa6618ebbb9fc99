"""Calibrates the intrinsics of a camera from a video in which a board is moved in front of it."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float

from ._board import LOOKS, Board, search
from ._films import some_frames

_FRAMES = 30  # more frames hardly change the result, and each costs a second if no board is visible
# A board held in front of the camera is not foreshortened much, so no stretched images are tried.
_LOOKS = LOOKS[:2]
_LENGTHS = (
    0.6,
    1.2,
    2.4,
)  # focal lengths, as shares of the image's longer side: fields of view of 80, 45 and 24 degrees
_LEAST = 6  # views of a plane: three determine a lens without distortion, twice as many reveal an error


@dataclass(frozen=True)
class Intrinsics:
    """Intrinsics of a camera, and its image size.

    Attributes:
        K: Intrinsic matrix (px).
        dist: OpenCV's k1, k2, p1, p2 and optionally k3, k4, k5, k6; for a fisheye lens k1, k2, k3, k4 of cv2.fisheye.
        size: Width and height of the image (px).
        rms: Root mean square reprojection error of the corners (px); None if the lens was read from a file.
        fisheye: Whether the lens model is that of `cv2.fisheye`; such lenses are only read from files, not calibrated
            here.
    """

    K: Float[np.ndarray, "3 3"]
    dist: Float[np.ndarray, " n"]
    size: tuple[int, int]
    rms: float | None = None
    fisheye: bool = False


def board_intrinsics(film: str | Path, board: Board) -> Intrinsics:
    """Calibrate a camera from a film of a board that is tilted and moved over the whole image.

    Raises:
        ValueError: The board is seen in too few frames.
    """
    views, size, looks = [], (0, 0), _LOOKS
    for image in some_frames(film, _FRAMES):
        size = (image.shape[1], image.shape[0])
        seen = search(image, board, looks)
        if seen is not None:
            views.append(seen[0][:, None].astype(np.float32))
            looks = (seen[1], *_LOOKS)
    if len(views) < _LEAST:
        raise ValueError(
            f"{film}: a board of {board.columns} x {board.rows} inner corners is found in {len(views)} of {_FRAMES} "
            f"frames; {_LEAST} are needed: hold it still, tilted, at several places of the image"
        )
    points = [board.points[:, None].astype(np.float32)] * len(views)
    # OpenCV's own start value is poor if all tilts are alike; starting from a wide, a normal and a long lens is safe.
    best = None
    for length in _LENGTHS:
        focal, (width, height) = length * max(size), size
        start = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
        rms, K, dist, _, _ = cv2.calibrateCamera(
            points, views, size, start, np.zeros(5), flags=cv2.CALIB_USE_INTRINSIC_GUESS
        )
        if best is None or rms < best[0]:
            best = float(rms), np.asarray(K, np.float64), np.asarray(dist, np.float64).reshape(-1)
    assert best is not None
    return Intrinsics(best[1], best[2], size, best[0])
