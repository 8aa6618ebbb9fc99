"""The outline of a silhouette as a few whole numbers: what a browser fills, whatever the size of the image."""

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, Int16

LONG_SIDE = 640
"""Longer side of a view on the page when it is enlarged (px); outlines are as fine as that needs."""
UNITS = 4
"""Steps of a coordinate for each pixel of the display."""
LONGEST_STEP = 127
"""Neighbours on an outline are no farther apart in either coordinate (steps of a coordinate): 8 bits hold it."""
UNSEEN = -32768
"""Stands for a point that a view does not show."""

# How far a simplified outline may leave the true one (px of the display). What is filled then agrees with what was
# seen to 0.99 (intersection over union) for a person of 300 px; a pixel would leave 0.975, and a third of the points.
_TOLERANCE = 0.35


def display_scale(size: Int[np.ndarray, "2"]) -> float:
    """Pixels of the display for each pixel of an image of this width and height; no image is blown up."""
    return min(1.0, LONG_SIDE / int(size.max()))


def to_units(uv: Float[np.ndarray, "*batch 2"], scale: float) -> Int16[np.ndarray, "*batch 2"]:
    """Image points (px, whole numbers at pixel centres) in steps of the display, counted from the image's corner.

    Points that are NaN, or too far off the image for 16 bits, are `UNSEEN`.
    """
    steps = np.round((uv + 0.5) * scale * UNITS)
    held = (np.abs(steps) < -UNSEEN).all(axis=-1, keepdims=True)
    return np.where(held, steps, UNSEEN).astype(np.int16)


def outlines(mask: Bool[np.ndarray, "h w"], scale: float) -> list[Int16[np.ndarray, "n 2"]]:
    """The closed outlines of a silhouette, in steps of the display.

    They run through the centres of the pixels at the rim, so that a line nearly as wide as a pixel along them, and
    the inside by the even-odd rule (holes are outlines too), cover the silhouette. Specks below a pixel of the
    display are left out.
    """
    found, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    seen = (contour[:, 0] for contour in found if max(cv2.boundingRect(contour)[2:]) * scale >= 1)
    simple = (cv2.approxPolyDP(contour, _TOLERANCE / scale, True)[:, 0].astype(np.float64) for contour in seen)
    return [_in_small_steps(to_units(line, scale)) for line in simple]


def _in_small_steps(line: Int16[np.ndarray, "n 2"]) -> Int16[np.ndarray, "m 2"]:
    """The same line with points between those that are too far apart."""
    steps = np.abs(np.diff(line.astype(np.int64), axis=0)).max(axis=1)
    at = np.concatenate([[0], np.cumsum(np.maximum(1, -(-steps // LONGEST_STEP)))])
    return np.stack([np.interp(np.arange(at[-1] + 1), at, line[:, k]) for k in (0, 1)], -1).round().astype(np.int16)
