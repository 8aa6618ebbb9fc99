"""Background model for cloth of one colour, as in Straka et al.'s set-up (Sect. 4.1) and in film studios."""

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

# Threshold half-way from the cloth's colour to grey. Light reflected by the cloth shifts skin and clothes towards its
# colour; folds and lamps shift the cloth towards grey; half-way leaves most room for both.
_HALFWAY = 0.5
# A shadow leaves a third of the light, 0.6 of the level (see `Plate`), of the darkest cloth in the images.
_DARKEST_SHADOW = 0.6
# Smallest ratio of the cloth's chroma to its luma: an eighth is the greyish green of a poor backdrop.
_LEAST_CHROMA = 0.125
# Below this level, a codec's noise of one or two levels is as large as the chroma of cloth.
_DARK = 16.0
# Width of the rim on each side of the image, as a share of it: it shows the room, not the person in the middle.
_RIM = 0.06
_OF_CLOTH = 0.5  # smallest share of the rim that must have the colour learned from it


@dataclass(frozen=True)
class ColouredBackdrop:
    """Cloth of one saturated colour, unevenly lit, folded, in shadow. Make one with [`backdrop_of`][].

    Cloth is recognised by chroma over luma: shading and shadows change both by the same factor, so shadows count as
    background in any light, and no image of the empty room is needed.

    Attributes:
        tint: Cr and Cb of the cloth, as shares of its luma.
        darkest: Luma of the darkest cloth (levels): anything much darker is not cloth in shadow but black hair or
            clothes.
    """

    tint: Float[np.ndarray, "2"]
    darkest: float

    def foreground(self, image: UInt8[np.ndarray, "h w 3"]) -> Bool[np.ndarray, "h w"]:
        """Pixels that do not show the cloth: nearer to grey than to its colour, of another hue, or too dark."""
        luma, along, across = self._compared(image)
        return ~((along > _HALFWAY) & (np.abs(across) < _HALFWAY) & (luma > _DARKEST_SHADOW * self.darkest))

    def _compared(self, image: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Luma (levels), and chroma in units of the cloth's: along it (1 is the cloth, 0 grey) and across."""
        luma, tints = _tints(image)
        unit = (self.tint / (self.tint @ self.tint)).astype(np.float32)
        return luma, tints @ unit, tints @ np.array([-unit[1], unit[0]])


def backdrop_of(images: Iterable[UInt8[np.ndarray, "h w 3"]]) -> ColouredBackdrop:
    """Learn the colour of the cloth from the rims of some images of the room, with or without the person.

    Raises:
        ValueError: There is no image, or less than half of the rims is of one saturated colour.
    """
    rims = [_rim(image) for image in images]
    if not rims:
        raise ValueError("the colour of a backdrop is learned from images, and there is none: is the video empty?")
    pixels = np.concatenate(rims)[None]
    luma, tints = (a[0] for a in _tints(pixels))
    bright = luma > _DARK
    tint = np.median(tints[bright], axis=0) if bright.any() else np.zeros(2)
    # Repeated with the pixels of that hue only, so that a lamp or a door in the rim does not count.
    for _ in range(2):
        found = ColouredBackdrop(tint.astype(np.float64), 0.0)
        cloth = bright & ~found.foreground(pixels)[0] if np.linalg.norm(tint) > _LEAST_CHROMA else np.zeros_like(bright)
        if cloth.mean() < _OF_CLOTH:
            raise ValueError(
                f"only {100 * cloth.mean():.0f} % of the rim of the images is of one saturated colour: is this a room "
                "with a coloured backdrop? give its colour, or film the empty room for a background plate"
            )
        tint = np.median(tints[cloth], axis=0)
    return ColouredBackdrop(tint.astype(np.float64), float(np.quantile(luma[cloth], 0.01)))


def backdrop_of_colour(blue: int, green: int, red: int) -> ColouredBackdrop:
    """A backdrop of a given colour, as it looks in the light; cloth down to a quarter of that level is recognised.

    Raises:
        ValueError: The colour is too grey or too dark to be told from clothes.
    """
    luma, tints = _tints(np.array([[[blue, green, red]]], np.uint8))
    if luma[0, 0] <= _DARK or np.linalg.norm(tints) <= _LEAST_CHROMA:
        raise ValueError(f"blue {blue}, green {green}, red {red} is too grey or too dark for a backdrop")
    return ColouredBackdrop(tints[0, 0].astype(np.float64), max(_DARK, 0.25 * float(luma[0, 0])) / _DARKEST_SHADOW)


def _tints(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Luma (levels), and Cr and Cb as shares of it."""
    planes = cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb).astype(np.float32)
    luma = planes[..., 0]
    return luma, (planes[..., 1:] - 128) / np.maximum(luma, 1)[..., None]


def _rim(image: np.ndarray) -> np.ndarray:
    """Pixels along the border, as a list; only every other row and column is used."""
    height, width = image.shape[:2]
    wide = max(1, round(_RIM * min(height, width)))
    inner = np.zeros((height, width), bool)
    inner[wide:-wide, wide:-wide] = True
    return image[::2, ::2][~inner[::2, ::2]]
