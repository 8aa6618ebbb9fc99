"""Finds a board in the frames of a video, or in one picture."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from ...io.files import fault, grab, is_picture, opened, read_image, retrieve
from ._board import LOOKS, Board, search

_FRAMES = 5  # number of frames, enough to tell whether the board is at rest
# Largest movement of a board at rest (px): its corners are found to a tenth of a pixel.
_AT_REST = 0.5


@dataclass(frozen=True)
class StillBoard:
    """Where a camera sees a board at rest.

    Attributes:
        corners: Mean over the frames, in the order of `Board.points` (px).
        spread: Root mean square distance of the corners from their mean over the frames (px); 0 for a single picture.
        frames: Number of frames in which the board was found.
        size: Width and height of the images (px).
    """

    corners: Float[np.ndarray, "corners 2"]
    spread: float
    frames: int
    size: tuple[int, int]


def still_board(film: str | Path, board: Board) -> StillBoard:
    """Find a board at rest in some frames of a video, or in a picture.

    Raises:
        ValueError: The film cannot be read, shows no board, or one that moves.
    """
    found: list[np.ndarray] = []
    size, looks = (0, 0), LOOKS
    for image in some_frames(film, _FRAMES):
        size = (image.shape[1], image.shape[0])
        seen = search(image, board, looks)
        if seen is not None:
            corners, look = seen
            looks = (look, *LOOKS)
            # A symmetric board may be found from its other end in each frame.
            turned = board.symmetric and found and _apart(corners[::-1], found[0]) < _apart(corners, found[0])
            found.append(corners[::-1] if turned else corners)
    if not found:
        raise ValueError(
            f"{film}: no board of {board.columns} x {board.rows} inner corners is found; all of it must be in view, "
            "with a white rim, larger or nearer if its squares are less than 10 px wide"
        )
    mean = np.mean(found, axis=0)
    moved = max(_apart(corners, mean) for corners in found)
    if moved > _AT_REST:
        raise ValueError(
            f"{film}: the board moves by {moved:.1f} px; all cameras must see it at one place: cut the video to where "
            "it rests"
        )
    spread = float(np.sqrt(np.mean(np.sum((np.array(found) - mean) ** 2, axis=-1))))
    return StillBoard(mean, spread, len(found), size)


def some_frames(film: str | Path, count: int) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
    """At most `count` frames of a video, evenly spread, in temporal order; a picture counts as one frame.

    Raises:
        ValueError: The file does not exist, or is no video or picture; one line that names it.
    """
    film = Path(film)
    if is_picture(film):
        yield read_image(film, cv2.IMREAD_COLOR)
        return
    capture = opened(film)
    try:
        total = capture.get(cv2.CAP_PROP_FRAME_COUNT)
        # The frame count of the header may be off, and seeking lands on key frames, so read all frames in order.
        wanted = set(((np.arange(count) + 0.5) * max(total, 1.0) / count).astype(int).tolist())
        number, given = 0, 0
        while number <= max(wanted) and grab(capture):
            image = retrieve(capture) if number in wanted else None
            if image is not None:
                given += 1
                yield image
            number += 1
    finally:
        capture.release()
    if given == 0:
        raise fault(film, None, "holds no frame that can be read; it is damaged or cut short: write it again")


def _apart(one: np.ndarray, other: np.ndarray) -> float:
    """Median distance of corners (px)."""
    return float(np.median(np.linalg.norm(one - other, axis=-1)))
