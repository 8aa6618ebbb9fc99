"""A silhouette without specks, holes and strangers."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool

# Of the square root of a silhouette's area. Seen from the front, a person covers 0.6 m^2, so this is 3.5 cm of him,
# whatever he measures in the image: two voxels. What is narrower than that says nothing about a limb.
_NARROW = 0.045


@dataclass(frozen=True)
class Cleaning:
    """What is done to a raw silhouette, in this order; each step is a switch."""

    smooth: bool = True
    """A pixel goes with the majority of its 3 x 3 neighbourhood: single pixels go, lines of two stay."""
    largest: bool = True
    """The largest connected part is the person. Parts less than 3.5 cm apart are one, without
    specks smaller than that."""
    fill: bool = True
    """Slits narrower than 3.5 cm are closed and holes of less than 3.5 cm by 3.5 cm filled: what is missing in one view
    is carved away for good. The gap between an arm and the trunk stays where it is wider."""

    def apply(self, mask: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
        """Clean a silhouette (True = person)."""
        cleaned = mask.astype(np.uint8)
        if self.smooth:
            cleaned = cv2.medianBlur(cleaned, 3)
        if self.largest:
            cleaned = _largest(cleaned)
        if self.fill:
            cleaned = _filled(cleaned)
        return cleaned.astype(bool)


def _largest(mask: np.ndarray) -> np.ndarray:
    # The person's size comes first: it tells how far apart his parts may be.
    parts = _parts(mask)
    sizes = _sizes(parts)
    if len(sizes) < 2:
        return mask
    whole = sizes > _NARROW**2 * sizes[1:].max()
    whole[0] = False
    mask = whole[parts].astype(np.uint8)
    wide = _odd(_NARROW * np.sqrt(sizes[1:].max()))
    # Each part grows by half of the gap: what then touches is one.
    parts = _parts(cv2.dilate(mask, np.ones((wide, wide), np.uint8))) * mask
    return (parts == 1 + np.argmax(_sizes(parts)[1:])).astype(np.uint8)


def _filled(mask: np.ndarray) -> np.ndarray:
    wide = _odd(_NARROW * np.sqrt(np.count_nonzero(mask)))
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (wide, wide)))
    # A rim of background joins what the silhouette parts at the border of the image: a hole is what it does not reach.
    parts = _parts(np.pad(1 - mask, 1, constant_values=1), connectivity=4)
    small = _sizes(parts) <= _NARROW**2 * np.count_nonzero(mask)
    small[parts[0, 0]] = False
    return small[parts[1:-1, 1:-1]].astype(np.uint8) | mask


def _parts(mask: np.ndarray, connectivity: int = 8) -> np.ndarray:
    """Number of the connected part that each pixel belongs to, 0 for none."""
    return np.asarray(cv2.connectedComponents(mask, connectivity=connectivity)[1], np.int32)


def _sizes(parts: np.ndarray) -> np.ndarray:
    """Pixels of each part; the first is what belongs to none."""
    return np.bincount(parts.ravel())


def _odd(width: float) -> int:
    """The odd number next to a width (px): a kernel of an even one would move the silhouette."""
    return 2 * round((width - 1) / 2) + 1
