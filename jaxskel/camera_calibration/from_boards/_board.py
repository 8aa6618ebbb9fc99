"""A checkerboard, and the detection of its corners in an image."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from ._saddles import refine_saddles

# Ways to look at an image (stretch factors, power of the levels), tried in turn until the board is found. A board on
# the floor is foreshortened, so that its squares are too flat to detect: the image is stretched vertically. White paper
# in bright light blooms over the corners of black squares, which no longer touch: a power of the levels removes it.
Look = tuple[tuple[int, int], float]
LOOKS: tuple[Look, ...] = tuple(product(((1, 1), (1, 2), (2, 2)), (1.0, 4.0, 8.0)))


@dataclass(frozen=True)
class Board:
    """A checkerboard.

    Attributes:
        columns: Inner corners along a row, where four squares meet: one less than the number of squares.
        rows: Inner corners along a column.
        square: Edge of a square (m).
    """

    columns: int
    rows: int
    square: float

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 3 or self.columns == self.rows:
            raise ValueError(
                f"a board of {self.columns} x {self.rows} inner corners: give two different numbers of 3 or more, "
                "one less each than there are squares; a square board can be turned by a quarter"
            )
        if not 1e-3 <= self.square <= 1:
            raise ValueError(f"squares of {self.square:g} m: give metres between 0.001 and 1")

    @property
    def symmetric(self) -> bool:
        """Whether the board looks the same after a half turn, so that the first corner is ambiguous."""
        return (self.columns + self.rows) % 2 == 0

    @property
    def points(self) -> Float[np.ndarray, "corners 3"]:
        """The corners, row by row, in the frame of the board (m): centred, x along the rows, z out of its face."""
        across, along = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        flat = np.stack([across - (self.columns - 1) / 2, along - (self.rows - 1) / 2], -1).reshape(-1, 2)
        return self.square * np.pad(flat, ((0, 0), (0, 1)))


def find_corners(image: UInt8[np.ndarray, "h w 3"], board: Board) -> Float[np.ndarray, "corners 2"] | None:
    """Find the corners (px) in the order of `Board.points`, seen from the face of the board; None without a board.

    The colours of the squares tell which end is the first; for a symmetric board this remains ambiguous.
    """
    found = search(image, board, LOOKS)
    return None if found is None else found[0]


def search(
    image: UInt8[np.ndarray, "h w 3"], board: Board, looks: Sequence[Look]
) -> tuple[Float[np.ndarray, "corners 2"], Look] | None:
    """The corners as `find_corners` returns them, and the look that found them, likely the next frame's too."""
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    for look in looks:
        (across, down), power = look
        large = cv2.resize(grey, None, fx=across, fy=down, interpolation=cv2.INTER_CUBIC)
        levels = np.rint(255 * (np.arange(256) / 255) ** power).astype(np.uint8)
        found, corners = cv2.findChessboardCornersSB(
            cv2.LUT(large, levels), (board.columns, board.rows), flags=cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
        )
        if found:
            # Integer coordinates are pixel centres in both images.
            corners = (corners.reshape(-1, 2).astype(np.float64) + 0.5) / (across, down) - 0.5
            return _ordered(refine_saddles(corners.reshape(board.rows, board.columns, 2), grey), grey, board), look
    return None


def _ordered(lattice: np.ndarray, grey: np.ndarray, board: Board) -> np.ndarray:
    along, down = lattice[0, -1] - lattice[0, 0], lattice[-1, 0] - lattice[0, 0]
    # Seen from its face, y is to the left of x; v points downwards in the image.
    if along[0] * down[1] - along[1] * down[0] > 0:
        lattice = lattice[::-1]
    if not board.symmetric and _first_is_white(lattice, grey):
        lattice = lattice[::-1, ::-1]
    return lattice.reshape(-1, 2)


def _first_is_white(lattice: np.ndarray, grey: np.ndarray) -> bool:
    """Whether the square between the first corners is white, judged by all squares because one may have glare."""
    middles = np.rint((lattice[1:, 1:] + lattice[:-1, :-1] + lattice[1:, :-1] + lattice[:-1, 1:]) / 4).astype(int)
    levels = grey[middles[..., 1], middles[..., 0]]
    even = np.indices(levels.shape).sum(0) % 2 == 0
    return bool(levels[even].mean() > levels[~even].mean())
