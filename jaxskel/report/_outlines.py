"""The outline of a silhouette as a few whole numbers: what a browser fills, whatever the size of the image."""

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, Int16

LONG_SIDE = 640
"""Longer side of a view on the page when it is enlarged (px); outlines are as fine as that needs."""
UNITS = 8
"""Steps of a coordinate for each pixel of the display."""
UNSEEN = -32768
"""Stands for a point that a view does not show."""

# How far a simplified outline may leave the true one (px of the display). A slim person is 40 px wide there: with half
# a pixel on both sides, most of it on one side of a corner only, the area is still right to one percent.
_TOLERANCE = 0.5


def display_scale(size: Int[np.ndarray, "2"]) -> float:
    """Pixels of the display for each pixel of an image of this width and height; images are never blown up."""
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

    They run through the centres of the pixels at the rim, so that a line as wide as a pixel along them, and the
    inside by the even-odd rule (holes are outlines too), cover the silhouette. Specks below a pixel of the display
    are left out.
    """
    found, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    seen = (contour[:, 0] for contour in found if max(cv2.boundingRect(contour)[2:]) * scale >= 1)
    return [to_units(cv2.approxPolyDP(c, _TOLERANCE / scale, True)[:, 0].astype(np.float64), scale) for c in seen]
