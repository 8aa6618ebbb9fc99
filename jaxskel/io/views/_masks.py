"""What a silhouette is in an image."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from jaxtyping import Bool, Shaped


@runtime_checkable
class Matte(Protocol):
    """Tells the person from the rest of an image."""

    def foreground(self, image: Shaped[np.ndarray, "h w *channels"]) -> Bool[np.ndarray, "h w"]:
        """True where the person is.

        Raises:
            ValueError: What is wrong with the image; the caller adds which one it is.
        """
        ...


# Channels of a grey image differ by what a video codec does to them, at most.
_GREY = 48
_MOST_COLOURED = 0.01


@dataclass(frozen=True)
class Masks:
    """Images that are masks already: white, or opaque where they have an alpha channel, is the person."""

    ones: bool = False
    """Whether an image without larger values than 1 is a mask too; not so where a codec makes a 1 of a 0."""

    def foreground(self, image: Shaped[np.ndarray, "h w *channels"]) -> Bool[np.ndarray, "h w"]:
        """True where the mask is at least half white."""
        if image.ndim == 3:
            image = self._one_channel(image)
        if image.dtype == np.uint16:
            image = image // 257
        return image >= (1 if self.ones and image.max() <= 1 else 128)

    def _one_channel(self, image: Shaped[np.ndarray, "h w channels"]) -> Shaped[np.ndarray, "h w"]:
        if image.shape[2] == 4 and image[:, :, 3].min() < image[:, :, 3].max():
            return image[:, :, 3]
        colours = image[:, :, :3]
        if colours.dtype == np.uint8 and _coloured(colours) > _MOST_COLOURED * colours[..., 0].size:
            raise ValueError("is a picture in colour, not a mask; give it as images or video with a background")
        return np.ascontiguousarray(colours[:, :, 0 if image.shape[2] < 3 else 1])


def _coloured(colours: Shaped[np.ndarray, "h w channels"]) -> int:
    """Number of pixels that are not grey; by OpenCV, which takes a tenth of NumPy's time."""
    first, *others = cv2.split(colours)
    off = np.zeros_like(first)
    for channel in others:
        off = np.maximum(off, cv2.absdiff(first, channel))
    return int(np.count_nonzero(off > _GREY))
