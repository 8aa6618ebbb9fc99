"""The rim of a silhouette, where pixels mix the colours of person and background."""

import cv2
import numpy as np
from jaxtyping import Bool, Float

# Lenses, codecs and motion mix colours up to this distance from an outline (px).
_MIXED = 2
# The person's colour at a mixed pixel is estimated from pure pixels up to this distance away (px).
_NEAR = 4
_HALF = 0.5


def without_thin_air(
    mask: Bool[np.ndarray, "h w"],
    seen: Float[np.ndarray, "h w 3"],
    expected: Float[np.ndarray, "h w 3"],
) -> Bool[np.ndarray, "h w"]:
    """Remove pixels of the rim that show less of the person than of the background.

    The mask contains every pixel that differs from the background at all. A share of a tenth of the person is enough
    for that, which makes a silhouette too wide by a pixel all around. As in matting, the person's share of a pixel
    follows from its colour, between that of the background and that of the person nearby.

    Args:
        mask: Pixels that differ from the background (True = person).
        seen: The image, in any linear colour space.
        expected: The background alone, in the same colour space.
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
