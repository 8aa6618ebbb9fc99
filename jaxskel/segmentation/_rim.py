"""The rim of a silhouette, where pixels show part of the person and part of the background."""

import cv2
import numpy as np
from jaxtyping import Bool, Float

# Lenses, codecs and motion mix colours over this far from an outline (px).
_MIXED = 2
# The person's colour beside a mixed pixel is that of the pure ones not farther than this (px).
_NEAR = 4
_HALF = 0.5


def without_thin_air(
    mask: Bool[np.ndarray, "h w"],
    seen: Float[np.ndarray, "h w 3"],
    expected: Float[np.ndarray, "h w 3"],
) -> Bool[np.ndarray, "h w"]:
    """Take away the pixels of the rim that show less of the person than of the background.

    What differs from the background at all is found first: a tenth of the person in a pixel suffices for that, and
    makes a silhouette too wide by a pixel all around. How much of a pixel is the person is told by its colour, between
    the background's and that of the person beside it, as in matting.

    Args:
        mask: What differs (True = person).
        seen: The image, in any linear colour space.
        expected: The background alone, likewise.
    """
    raw = mask.astype(np.uint8)
    width = 2 * _MIXED + 1
    pure = cv2.erode(raw, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width)))
    wide = 2 * (_MIXED + _NEAR) + 1
    amount = cv2.boxFilter(pure, cv2.CV_32F, (wide, wide), normalize=False)
    rows, columns = np.nonzero((raw > pure) & (amount > 0.5))
    person = cv2.boxFilter(seen * pure[..., None], cv2.CV_32F, (wide, wide), normalize=False)[rows, columns]
    apart = person / amount[rows, columns, None] - expected[rows, columns]
    off = seen[rows, columns] - expected[rows, columns]
    share = (off * apart).sum(1) / np.maximum((apart**2).sum(1), 1e-6)
    thin = share < _HALF
    kept = mask.copy()
    kept[rows[thin], columns[thin]] = False
    return kept
