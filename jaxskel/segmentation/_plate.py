"""Background model learned from images by a static camera: a clean plate, or a median over time.

The decision for each pixel is that of Horprasert, Harwood and Davis (ICCV Frame-Rate Workshop, 1999): a colour is
split into a multiple of the plate's colour, which a shadow changes, and the rest, which it does not. The noise is
measured: over time for each pixel, and over the image for each frame.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from ._rim import without_thin_air

# Largest number of images kept: their median is off by a fifth of the noise, and 50 HD images take 0.3 GB.
_KEPT = 50
# A pixel differs if it is this many standard deviations off. With Gaussian noise, one in two images of a megapixel
# would have a false pixel; codec noise has longer tails, but single pixels are removed by the cleaning.
_SIGMAS = 5.0
# Smallest ratio of levels in a shadow: with the usual gamma of 2.2, a third of the light. Rooms for multi-view filming
# have several lamps, and a person blocks only some of them.
_DARKEST_SHADOW = 0.6
# Light in a shadow has another tint than the lamp's, and clothes reflect theirs: a pixel's chroma may differ from the
# plate's by this share of its luma, beyond noise.
_TINT = 0.03
# Movement of a camera that people walk beside (px). It matters at edges in the background.
_SWAY = 0.25
# Standard deviation of rounding to levels, done twice in most codecs (to luma and chroma and back): a lower bound.
_ROUNDING = 0.5
# Levels at which the gain is measured: darker ones are noise, brighter ones may be clipped.
_MEASURABLE = (30.0, 245.0)
_SAMPLES = 5_000  # pixels, enough to estimate gain and noise of a frame to a fiftieth of the noise
# Coefficients of blue, green and red (columns) in luma, Cr and Cb (rows): ITU-R BT.601, as in codecs.
_LUMA_CHROMA = np.array([[0.114, 0.587, 0.299], [-0.081312, -0.418688, 0.5], [0.5, -0.331264, -0.168736]], np.float32)
_MAD = 1.4826  # ratio of standard deviation to median absolute deviation of a Gaussian


@dataclass(frozen=True)
class Plate:
    """A static background, seen by a camera that does not move. Make one with [`plate_of`][].

    Attributes:
        mean: Colours of the background (levels; blue, green, red).
        spread: Standard deviation of luma, Cr and Cb (levels): noise over time, rounding, and edges moved by camera
            sway.
        shadows: Whether shadows count as background. A shadow leaves at least 0.6 of the level and keeps the tint;
            parts of a person that look like that against the background are lost too.
    """

    mean: Float[np.ndarray, "h w 3"]
    spread: Float[np.ndarray, "h w 3"]
    shadows: bool = True

    def foreground(self, image: UInt8[np.ndarray, "h w 3"]) -> Bool[np.ndarray, "h w"]:
        """Pixels at which the image shows something other than the plate.

        The gain of each channel (from automatic exposure and white balance) and the noise of the frame are measured by
        medians over the image and compensated, so more than half of the image must show the background.

        Raises:
            ValueError: The image is not of the plate's size.
        """
        if image.shape != self.mean.shape:
            (height, width), (h, w) = self.mean.shape[:2], image.shape[:2]
            raise ValueError(f"the image is {w} x {h} px but the background plate {width} x {height}: film both alike")
        gain = self._gain(image)
        # Levels as they would be with the gain of the plate.
        levels = np.minimum(np.arange(256)[:, None, None] / gain, 255).astype(np.float32).transpose(1, 0, 2)
        seen = luma_chroma(cv2.LUT(image, levels))
        # OpenCV takes a tenth of NumPy's time here.
        limit = _SIGMAS * cv2.sqrt(cv2.add(self._variance, np.append(self._noise(seen) ** 2, 0.0)))
        beyond = cv2.compare(cv2.absdiff(seen, self._expected), limit, cv2.CMP_GT)
        differs = cv2.inRange(beyond, (0, 0, 0), (0, 0, 0)) == 0
        # A clipped background may be any brighter colour of any tint, so only darker pixels differ from it.
        clipped = np.nonzero(self._brightest * gain.max() > _MEASURABLE[1])
        differs[clipped] = seen[clipped][:, 0] < (self._expected[clipped] - limit[clipped])[:, 0]
        if self.shadows:
            chosen = np.nonzero(differs)
            shadow = _in_shadow(seen[chosen], self._expected[chosen], limit[chosen])
            differs[chosen] = ~shadow
        return without_thin_air(differs, seen, self._expected)

    @cached_property
    def _expected(self) -> np.ndarray:
        return luma_chroma(self.mean)

    @cached_property
    def _variance(self) -> np.ndarray:
        return self.spread**2

    @cached_property
    def _brightest(self) -> np.ndarray:
        return self.mean.max(2)

    def _gain(self, image: np.ndarray) -> Float[np.ndarray, "3"]:
        """Ratio of the image's levels to the plate's, by channel."""
        seen, mean = _some(image).astype(np.float32), _some(self.mean)
        usable = (mean > _MEASURABLE[0]) & (mean < _MEASURABLE[1]) & (seen > 0) & (seen < 255)
        gain = np.ones(3, np.float32)
        for c in range(3):
            if usable[:, c].any():
                gain[c] = _middle(seen[usable[:, c], c] / mean[usable[:, c], c])
        return gain

    def _noise(self, seen: np.ndarray) -> Float[np.ndarray, "3"]:
        """Standard deviation of luma, Cr and Cb (levels) in excess of the plate's."""
        rest = np.median(np.abs(_some(seen) - _some(self._expected)), axis=0)
        return np.sqrt(np.maximum((_MAD * rest) ** 2 - np.median(_some(self._variance), axis=0), 0.0)).astype(
            np.float64
        )


def luma_chroma(image: Float[np.ndarray, "h w 3"]) -> Float[np.ndarray, "h w 3"]:
    """Luma, Cr and Cb of blue, green, red (levels); chroma of grey is zero. Linear, so a factor on colours is kept.

    Cameras and codecs process luma and chroma separately, so their noise is best modelled separately, too.
    """
    return cv2.transform(image, _LUMA_CHROMA)


def plate_of(images: Iterable[UInt8[np.ndarray, "h w 3"]], shadows: bool = True) -> Plate:
    """Learn the background from a stream of images, of which at most 50, evenly spread, are kept in memory.

    From images of the empty scene this is a clean plate. From the frames of the recording itself it is a median over
    time, which needs a person who moves: every pixel must show the background more than half of the time.

    Args:
        images: At least one image (blue, green, red), all of one size.
        shadows: See [`Plate`][].

    Raises:
        ValueError: There is no image, or sizes differ.
    """
    kept = _evenly(images)
    if not kept:
        raise ValueError("a background plate needs at least one image: is the video empty?")
    mean, spread = np.empty(kept[0].shape, np.float32), np.empty(kept[0].shape, np.float32)
    # Row by row: sorting the whole stack would take several times its memory.
    for row in range(len(mean)):
        mean[row], spread[row] = _typical(np.stack([image[row] for image in kept]))
    edges = [cv2.Scharr(luma_chroma(mean), cv2.CV_32F, *axis, scale=1 / 32) for axis in ((1, 0), (0, 1))]
    spread = np.sqrt(spread**2 + _ROUNDING**2 + _SWAY**2 * (edges[0] ** 2 + edges[1] ** 2))
    return Plate(mean, spread, shadows)


def _evenly(images: Iterable[np.ndarray]) -> list[np.ndarray]:
    """Up to 50 images, evenly spread over a stream of unknown length: when full, every other one is dropped."""
    kept, step = [], 1
    stream = iter(images)
    first = next(stream, None)
    if first is None:
        return kept
    for number, image in enumerate(chain([first], stream)):
        if image.shape != first.shape:
            raise ValueError(f"image {number} has shape {image.shape}, but the first {first.shape}: give one camera's")
        if number % step == 0:
            if len(kept) == _KEPT:
                kept, step = kept[::2], 2 * step
            if number % step == 0:
                kept.append(image)
    return kept


def _typical(values: UInt8[np.ndarray, "n w 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Mean colours, and the spread of luma and chroma, of those images of a row that are near the median."""
    colours = values.astype(np.float32)
    off = np.abs(colours - np.median(colours, axis=0))
    near = (off <= 3 * np.maximum(_MAD * np.median(off, axis=0), _ROUNDING)).all(2, keepdims=True)
    # An image must be near in all channels; a pixel where no image is so uses all images.
    near |= ~near.any(0)
    count = near.sum(0)
    mean = (near * colours).sum(0) / count
    apart = luma_chroma(colours - mean)
    return mean, np.sqrt((near * apart**2).sum(0) / count)


def _some(image: np.ndarray) -> np.ndarray:
    """Pixels on a sparse grid."""
    step = max(1, round(np.sqrt(image[..., 0].size / _SAMPLES)))
    return image[::step, ::step].reshape(-1, image.shape[2])


def _middle(ratios: np.ndarray) -> float:
    """Median without outliers: a person, whose ratios all lie on one side, must not shift it."""
    middle = np.median(ratios)
    for _ in range(3):
        off = np.abs(ratios - middle)
        ratios = ratios[off <= 3 * _MAD * np.median(off) + 1e-6]
        middle = np.median(ratios)
    return float(middle)


def _in_shadow(
    seen: Float[np.ndarray, "n 3"], expected: Float[np.ndarray, "n 3"], limit: Float[np.ndarray, "n 3"]
) -> Bool[np.ndarray, " n"]:
    """Whether luma and chroma could be those expected in a shadow, up to noise and a tint."""
    luma = seen[:, :1]
    left = luma / np.maximum(expected[:, :1], 1)
    alike = (np.abs(seen - left * expected)[:, 1:] <= limit[:, 1:] + _TINT * luma).all(1)
    return alike & (left[:, 0] >= _DARKEST_SHADOW) & (left[:, 0] <= 1)
