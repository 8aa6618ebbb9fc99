"""The lens of a camera, from a video in which a board is moved about in front of it."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float

from ._board import LOOKS, Board, search
from ._films import some_frames

_FRAMES = 30  # more of them hardly change a lens, and each costs a second where no board is seen
# A board that is held before the camera is not foreshortened much.
_LOOKS = LOOKS[:2]
_LENGTHS = (
    0.6,
    1.2,
    2.4,
)  # focal lengths, as parts of the image's longer side: fields of view of 80, 45 and 24 degrees
_LEAST = 6  # views of a plane: three determine a lens without distortion, twice as many make an error show


@dataclass(frozen=True)
class Intrinsics:
    """A camera's lens and image."""

    K: Float[np.ndarray, "3 3"]
    """(px)"""
    dist: Float[np.ndarray, " n"]
    """OpenCV's k1, k2, p1, p2 and, if given, k3, k4, k5, k6; of a fisheye lens cv2.fisheye's k1, k2, k3, k4."""
    size: tuple[int, int]
    """Width and height of the image (px)."""
    rms: float | None = None
    """Of the corners that it was found from (px)."""
    fisheye: bool = False
    """Whether the lens model is that of `cv2.fisheye`: such lenses are read from a file, not found from a film."""


def board_intrinsics(film: str | Path, board: Board) -> Intrinsics:
    """Find the intrinsics of a camera from a film of a board that is turned and moved all over its image.

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
    # OpenCV's own start is poor where all tilts are alike; a descent from a wide, a usual or a long lens is not.
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
