"""What the camera sees without the person, learned from images: a clean plate, or a median over time.

The decision, pixel by pixel, is that of Horprasert, Harwood and Davis (ICCV Frame-Rate Workshop, 1999): a colour is
split into a multiple of the plate's, which a shadow changes, and the rest, which it does not. Noise is measured: over
time in each pixel, and over the image in each frame.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from ._rim import without_thin_air

# Images that are kept at most: a median of so many is off by a fifth of the noise, and 50 HD images take 0.3 GB.
_KEPT = 50
# A pixel differs where it is this many standard deviations off. Were noise Gaussian, one image of a megapixel in
# two would have a false pixel; that of codecs has longer tails, and single pixels are cleaned away.
_SIGMAS = 5.0
# What a shadow leaves of the levels of an image: by the usual gamma of 2.2, a third of the light. Rooms that people are
# filmed in from all around have several lamps, each of them a part of it.
_DARKEST_SHADOW = 0.6
# The light that is left in a shadow is of another tint than the lamp's, and clothes reflect theirs: the part of a
# pixel's brightness by which its colour may differ from the plate's beyond noise.
_TINT = 0.03
# A camera that people walk beside moves by this much (px). It matters at the edges of what stands in the background.
_SWAY = 0.25
# Values are rounded to levels, twice in most codecs (of luma and colour, and back): never less noise than this.
_ROUNDING = 0.5
# Levels where a gain can be seen: darker ones are noise, brighter ones may be clipped.
_MEASURABLE = (30.0, 245.0)
_SAMPLES = 5_000  # pixels, by which gain and noise of a frame are known to a fiftieth of the noise
# Of blue, green, red: ITU-R BT.601, as codecs have it.
_LUMA_CHROMA = np.array([[0.114, 0.587, 0.299], [-0.081312, -0.418688, 0.5], [0.5, -0.331264, -0.168736]], np.float32)
_MAD = 1.4826  # median absolute deviation to standard deviation, of a Gaussian


@dataclass(frozen=True)
class Plate:
    """A static background, seen by a camera that does not move. Make one with [`plate_of`][]."""

    mean: Float[np.ndarray, "h w 3"]
    """Colours of the background (levels; blue, green, red)."""
    spread: Float[np.ndarray, "h w 3"]
    """Standard deviation of luma, Cr and Cb (levels): noise over time, rounding, and edges that sway."""
    shadows: bool = True
    """Shadows are recognised and are background. A shadow leaves at least half of the level and keeps the tint; parts
    of a person that look so beside the background are lost with it."""

    def foreground(self, image: UInt8[np.ndarray, "h w 3"]) -> Bool[np.ndarray, "h w"]:
        """Where the image shows something else than the plate.

        Gains of the whole image, one a channel, are measured and allowed for (exposure and white balance that the
        camera adapts), and so is the noise of the frame: both by medians, so more than half of the image must show the
        background.

        Raises:
            ValueError: The image is not of the plate's size.
        """
        if image.shape != self.mean.shape:
            (height, width), (h, w) = self.mean.shape[:2], image.shape[:2]
            raise ValueError(f"the image is {w} x {h} px but the background plate {width} x {height}: film both alike")
        gain = self._gain(image)
        # As the plate's camera would have seen it.
        levels = np.minimum(np.arange(256)[:, None, None] / gain, 255).astype(np.float32).transpose(1, 0, 2)
        seen = luma_chroma(cv2.LUT(image, levels))
        # By OpenCV, which takes a tenth of NumPy's time here.
        limit = _SIGMAS * cv2.sqrt(cv2.add(self._variance, np.append(self._noise(seen) ** 2, 0.0)))
        beyond = cv2.compare(cv2.absdiff(seen, self._expected), limit, cv2.CMP_GT)
        differs = cv2.inRange(beyond, (0, 0, 0), (0, 0, 0)) == 0
        # What is as bright as can be may be anything brighter, of any tint.
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
        """By how much the levels of each channel are those of the plate."""
        seen, mean = _some(image).astype(np.float32), _some(self.mean)
        usable = (mean > _MEASURABLE[0]) & (mean < _MEASURABLE[1]) & (seen > 0) & (seen < 255)
        gain = np.ones(3, np.float32)
        for c in range(3):
            if usable[:, c].any():
                gain[c] = _middle(seen[usable[:, c], c] / mean[usable[:, c], c])
        return gain

    def _noise(self, seen: np.ndarray) -> Float[np.ndarray, "3"]:
        """Standard deviation of luma, Cr and Cb (levels) beyond the plate's."""
        rest = np.median(np.abs(_some(seen) - _some(self._expected)), axis=0)
        return np.sqrt(np.maximum((_MAD * rest) ** 2 - np.median(_some(self._variance), axis=0), 0.0)).astype(
            np.float64
        )


def luma_chroma(image: Float[np.ndarray, "h w 3"]) -> Float[np.ndarray, "h w 3"]:
    """Luma, Cr and Cb of blue, green, red (levels), zero for greys: a factor on the colours is one on these.

    Cameras and codecs keep luma and chroma apart, hence their noise is best told apart here.
    """
    return cv2.transform(image, _LUMA_CHROMA)


def plate_of(images: Iterable[UInt8[np.ndarray, "h w 3"]], shadows: bool = True) -> Plate:
    """Learn the background from images, each looked at once; 50 of them, evenly spread, are kept meanwhile.

    From images of the empty scene this is a clean plate. From the frames of a recording itself it is a median over
    time, which needs a person who moves: every place must show the background in more than half of the time.

    Args:
        images: All of one size, at least one.
        shadows: See [`Plate`][].

    Raises:
        ValueError: There is no image, or sizes differ.
    """
    kept = _evenly(images)
    if not kept:
        raise ValueError("a background plate needs at least one image: is the video empty?")
    mean, spread = np.empty(kept[0].shape, np.float32), np.empty(kept[0].shape, np.float32)
    # Row by row: the sorted stack of all would take several times its size.
    for row in range(len(mean)):
        mean[row], spread[row] = _typical(np.stack([image[row] for image in kept]))
    edges = [cv2.Scharr(luma_chroma(mean), cv2.CV_32F, *axis, scale=1 / 32) for axis in ((1, 0), (0, 1))]
    spread = np.sqrt(spread**2 + _ROUNDING**2 + _SWAY**2 * (edges[0] ** 2 + edges[1] ** 2))
    return Plate(mean, spread, shadows)


def _evenly(images: Iterable[np.ndarray]) -> list[np.ndarray]:
    """Up to 50 images, evenly spread over a stream of unknown length: when all places are taken, every other goes."""
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
    """Mean colours, and the spread of luma and chroma, of those images of a row that are near to the median."""
    colours = values.astype(np.float32)
    off = np.abs(colours - np.median(colours, axis=0))
    near = (off <= 3 * np.maximum(_MAD * np.median(off, axis=0), _ROUNDING)).all(2, keepdims=True)
    # A channel's median is not the others': where no image is near in all of them, all count.
    near |= ~near.any(0)
    count = near.sum(0)
    mean = (near * colours).sum(0) / count
    apart = luma_chroma(colours - mean)
    return mean, np.sqrt((near * apart**2).sum(0) / count)


def _some(image: np.ndarray) -> np.ndarray:
    """Pixels on a sparse lattice."""
    step = max(1, round(np.sqrt(image[..., 0].size / _SAMPLES)))
    return image[::step, ::step].reshape(-1, image.shape[2])


def _middle(ratios: np.ndarray) -> float:
    """The median of those that are near to it: a person on one side of it must not pull it there."""
    middle = np.median(ratios)
    for _ in range(3):
        off = np.abs(ratios - middle)
        ratios = ratios[off <= 3 * _MAD * np.median(off) + 1e-6]
        middle = np.median(ratios)
    return float(middle)


def _in_shadow(
    seen: Float[np.ndarray, "n 3"], expected: Float[np.ndarray, "n 3"], limit: Float[np.ndarray, "n 3"]
) -> Bool[np.ndarray, " n"]:
    """Luma and chroma that are a plausible part of the expected ones, up to noise and a tint."""
    luma = seen[:, :1]
    left = luma / np.maximum(expected[:, :1], 1)
    alike = (np.abs(seen - left * expected)[:, 1:] <= limit[:, 1:] + _TINT * luma).all(1)
    return alike & (left[:, 0] >= _DARKEST_SHADOW) & (left[:, 0] <= 1)
