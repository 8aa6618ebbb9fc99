"""Closes details of a silhouette below the pixel resolution: gaps between fingers, and tips a pixel or two wide.

An outline taken as the zero of a smooth distance lies up to half a pixel too deep between fingers, and does so in all
frames that show the hand from the same side. Closing the gaps leaves the tips in place; outlines that remain poorly
resolved get less weight.
"""

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

# Half the side (cells) of the square around an outline point in which its resolution is measured: distances are smooth
# over about this length.
_NEAR = 4


def without_gaps(mask: Bool[np.ndarray, "h w"], step: int) -> Bool[np.ndarray, "h w"]:
    """A silhouette whose gaps of up to two cells of `step` pixels are closed."""
    square = np.ones((2 * step + 1, 2 * step + 1), np.uint8)
    # Pad with background: with OpenCV's default border a person a pixel away from the edge would reach it.
    closed = cv2.morphologyEx(
        mask.view(np.uint8), cv2.MORPH_CLOSE, square, borderType=cv2.BORDER_CONSTANT, borderValue=(0,)
    )
    return closed.view(bool) | mask


def silhouettes_without_gaps(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"], step: int
) -> UInt8[np.ndarray, "frames cams h w8"]:
    """Packed silhouettes with gaps of up to two cells of `step` pixels closed."""
    closed = np.zeros_like(silhouettes)
    for frame, view in zip(*np.nonzero(silhouettes.any((2, 3))), strict=True):
        mask = np.unpackbits(silhouettes[frame, view], axis=1).view(bool)
        closed[frame, view] = np.packbits(without_gaps(mask, step), axis=1)
    return closed


def outline_error(mask: Bool[np.ndarray, "h w"], step: int) -> Float[np.ndarray, "h w"]:
    """Standard deviation of an outline near each pixel, relative to a smooth outline (1).

    The variance grows with the area (cells) that differs from the majority of its neighbourhood. Along a straight edge
    that area is zero: of two pixels on opposite sides of a person's pixel, at least one belongs to the person too.
    """
    side, near = 2 * step + 1, 2 * _NEAR * step + 1
    most = cv2.boxFilter(mask.astype(np.float32), -1, (side, side)) > 0.5
    unlike = cv2.boxFilter((most != mask).astype(np.float32), -1, (near, near))
    # The box mean is inexact, so round.
    return np.sqrt(1 + np.round(unlike * near**2) / step**2)
