"""Outlines of silhouettes as few integers, which a browser can fill, whatever the size of the image."""

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, Int16

LONG_SIDE = 640
"""Longer side of an enlarged view on the page (px), which decides the resolution of outlines."""
UNITS = 4
"""Coordinate units per pixel of the display."""
LONGEST_STEP = 127
"""Largest difference of consecutive outline points in either coordinate (units), so that 8 bits suffice."""
UNSEEN = -32768
"""Marks a point that a view does not see."""

# Largest deviation of a simplified outline (display px). It keeps an intersection over union of 0.99 for a person of
# 300 px; one pixel would give 0.975 with a third of the points.
_TOLERANCE = 0.35


def display_scale(size: Int[np.ndarray, "2"]) -> float:
    """Display pixels per image pixel for an image of this width and height (px); images are never enlarged."""
    return min(1.0, LONG_SIDE / int(size.max()))


def to_units(uv: Float[np.ndarray, "*batch 2"], scale: float) -> Int16[np.ndarray, "*batch 2"]:
    """Convert image points (px, integers at pixel centres) to display units, with the origin at the image's corner.

    NaN points, and points too far outside the image for 16 bits, become `UNSEEN`.
    """
    steps = np.round((uv + 0.5) * scale * UNITS)
    held = (np.abs(steps) < -UNSEEN).all(axis=-1, keepdims=True)
    return np.where(held, steps, UNSEEN).astype(np.int16)


def outlines(mask: Bool[np.ndarray, "h w"], scale: float) -> list[Int16[np.ndarray, "n 2"]]:
    """The closed outlines of a silhouette, in display units.

    They pass through the centres of boundary pixels. So the silhouette is covered by a line nearly one pixel wide along
    them, plus the inside by the even-odd rule (holes are outlines too). Specks below a display pixel are left out.
    """
    found, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    seen = (contour[:, 0] for contour in found if max(cv2.boundingRect(contour)[2:]) * scale >= 1)
    simple = (cv2.approxPolyDP(contour, _TOLERANCE / scale, True)[:, 0].astype(np.float64) for contour in seen)
    return [_in_small_steps(to_units(line, scale)) for line in simple]


def _in_small_steps(line: Int16[np.ndarray, "n 2"]) -> Int16[np.ndarray, "m 2"]:
    """The line with points inserted between those that are too far apart."""
    steps = np.abs(np.diff(line.astype(np.int64), axis=0)).max(axis=1)
    at = np.concatenate([[0], np.cumsum(np.maximum(1, -(-steps // LONGEST_STEP)))])
    return np.stack([np.interp(np.arange(at[-1] + 1), at, line[:, k]) for k in (0, 1)], -1).round().astype(np.int16)
