"""What pixels do not resolve of a silhouette: the gaps between fingers, and tips that are a pixel or two wide.

An outline that is found as the zero of a smooth distance runs too deep where fingers leave gaps between them, by up to
half a pixel, and does so in all frames that show the hand from the same side. Closed gaps leave the tips where they
are; what is left is known to be poor and weighs less.
"""

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

# Half the side (cells) of the square around a point of an outline that tells how well it is resolved: a distance is
# smooth over about as many.
_NEAR = 4


def without_gaps(mask: Bool[np.ndarray, "h w"], step: int) -> Bool[np.ndarray, "h w"]:
    """A silhouette whose gaps of up to two cells of `step` pixels are closed."""
    square = np.ones((2 * step + 1, 2 * step + 1), np.uint8)
    # Nobody is beyond the edges: by OpenCV's default a person who is a pixel away from one would reach it.
    closed = cv2.morphologyEx(
        mask.view(np.uint8), cv2.MORPH_CLOSE, square, borderType=cv2.BORDER_CONSTANT, borderValue=(0,)
    )
    return closed.view(bool) | mask


def silhouettes_without_gaps(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"], step: int
) -> UInt8[np.ndarray, "frames cams h w8"]:
    """Likewise packed silhouettes."""
    closed = np.zeros_like(silhouettes)
    for frame, view in zip(*np.nonzero(silhouettes.any((2, 3))), strict=True):
        mask = np.unpackbits(silhouettes[frame, view], axis=1).view(bool)
        closed[frame, view] = np.packbits(without_gaps(mask, step), axis=1)
    return closed


def outline_error(mask: Bool[np.ndarray, "h w"], step: int) -> Float[np.ndarray, "h w"]:
    """How much an outline errs near each pixel, 1 where it is smooth (standard deviations).

    The variance grows with the area (cells) that differs from what most of its neighbours are. Along a straight edge
    none does: of two pixels that lie opposite each other about one on the person, one at least is on the person, too.
    """
    side, near = 2 * step + 1, 2 * _NEAR * step + 1
    most = cv2.boxFilter(mask.astype(np.float32), -1, (side, side)) > 0.5
    unlike = cv2.boxFilter((most != mask).astype(np.float32), -1, (near, near))
    # The mean of a square is some rounding off zero.
    return np.sqrt(1 + np.round(unlike * near**2) / step**2)
