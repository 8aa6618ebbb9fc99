"""A room hung with cloth of one colour: Straka et al.'s own set-up (Sect. 4), and that of every film studio."""

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

# Half of the way from the cloth's colour to grey. Light that the cloth throws on a person takes skin and clothes some
# way towards its colour, folds and lamps take the cloth some way towards grey: halfway leaves most room to both.
_HALFWAY = 0.5
# A shadow leaves a third of the light, 0.6 of the level (see `Plate`), of the darkest cloth that was seen.
_DARKEST_SHADOW = 0.6
# Cloth has this much chroma for its luma at least: an eighth is the greyish green of a bad key.
_LEAST_CHROMA = 0.125
# Levels below which a codec's noise of one or two levels is as large as the chroma of cloth.
_DARK = 16.0
# The rim of an image shows the room, not the person, who stands in the middle: this part of it on each side.
_RIM = 0.06
_OF_CLOTH = 0.5  # of the rim at least must be of the colour that is learned from it


@dataclass(frozen=True)
class ColouredBackdrop:
    """Cloth of one saturated colour, unevenly lit, folded, in shadow. Make one with [`backdrop_of`][].

    Chroma over luma says which it is: shading and shadows change both alike, so shadows are background whatever the
    light, and no image of the empty room is needed.
    """

    tint: Float[np.ndarray, "2"]
    """Cr and Cb of the cloth, as parts of its luma."""
    darkest: float
    """Luma of the darkest cloth (levels): what is much darker is no cloth in shadow but black hair or clothes."""

    def foreground(self, image: UInt8[np.ndarray, "h w 3"]) -> Bool[np.ndarray, "h w"]:
        """Where the image does not show the cloth: nearer to grey than to its colour, of another hue, or too dark."""
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
    # Again among those of that hue: a lamp or a door in the rim must not count.
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
    """Luma (levels), and Cr and Cb as parts of it."""
    planes = cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb).astype(np.float32)
    luma = planes[..., 0]
    return luma, (planes[..., 1:] - 128) / np.maximum(luma, 1)[..., None]


def _rim(image: np.ndarray) -> np.ndarray:
    """The pixels along the border, in a row; every other line is enough."""
    height, width = image.shape[:2]
    wide = max(1, round(_RIM * min(height, width)))
    inner = np.zeros((height, width), bool)
    inner[wide:-wide, wide:-wide] = True
    return image[::2, ::2][~inner[::2, ::2]]
