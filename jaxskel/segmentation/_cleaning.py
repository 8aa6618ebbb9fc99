"""Cleaning of silhouettes: removes specks, holes and other people."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool

# Share of the root of a silhouette's area. Seen from the front, a person covers 0.6 m^2, so this is 3.5 cm (two voxels)
# at any image scale. Narrower structures say nothing about a limb.
_NARROW = 0.045


@dataclass(frozen=True)
class Cleaning:
    """Steps applied to a raw silhouette, in this order; each can be switched off.

    Attributes:
        smooth: 3 x 3 majority (median) filter: removes single pixels, keeps lines two pixels wide.
        largest: Keep the largest connected part as the person, without smaller ones. Parts less than 3.5 cm apart count
            as connected, except for specks of less than 3.5 cm by 3.5 cm.
        fill: Close slits narrower than 3.5 cm and fill holes of less than 3.5 cm by 3.5 cm: what is missing in one view
            is carved away for good. Wider gaps between an arm and the trunk stay.
    """

    smooth: bool = True
    largest: bool = True
    fill: bool = True

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
    # The person's size is estimated first, because the largest gap between their parts depends on it.
    parts = _parts(mask)
    sizes = _sizes(parts)
    if len(sizes) < 2:
        return mask
    whole = sizes > _NARROW**2 * sizes[1:].max()
    whole[0] = False
    mask = whole[parts].astype(np.uint8)
    wide = _odd(_NARROW * np.sqrt(sizes[1:].max()))
    # Each part grows by half the gap; parts that touch then are connected.
    parts = _parts(cv2.dilate(mask, np.ones((wide, wide), np.uint8))) * mask
    return (parts == 1 + np.argmax(_sizes(parts)[1:])).astype(np.uint8)


def _filled(mask: np.ndarray) -> np.ndarray:
    wide = _odd(_NARROW * np.sqrt(np.count_nonzero(mask)))
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (wide, wide)))
    # A border of background connects the background that the silhouette divides at the image border; holes stay apart.
    parts = _parts(np.pad(1 - mask, 1, constant_values=1), connectivity=4)
    small = _sizes(parts) <= _NARROW**2 * np.count_nonzero(mask)
    small[parts[0, 0]] = False
    return small[parts[1:-1, 1:-1]].astype(np.uint8) | mask


def _parts(mask: np.ndarray, connectivity: int = 8) -> np.ndarray:
    """Index of the connected part of each pixel, 0 for none."""
    return np.asarray(cv2.connectedComponents(mask, connectivity=connectivity)[1], np.int32)


def _sizes(parts: np.ndarray) -> np.ndarray:
    """Number of pixels of each part; the first is the number of pixels in none."""
    return np.bincount(parts.ravel())


def _odd(width: float) -> int:
    """The odd integer nearest to a width (px): an even kernel would shift the silhouette."""
    return 2 * round((width - 1) / 2) + 1
