"""Extracts the mask from an image's channels, and describes its values."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from jaxtyping import Shaped, UInt32

# Largest number of labels for parts or people in the masks of one camera; an image with more values is a picture.
MOST_VALUES = 64
# Largest difference of the channels of a grey image after video compression.
_GREY = 48
_MOST_COLOURED = 0.01


@runtime_checkable
class Values(Protocol):
    """Extracts a mask from an image."""

    def of(self, image: Shaped[np.ndarray, "h w *channels"]) -> Shaped[np.ndarray, "h w"]:
        """One number for each pixel.

        Raises:
            ValueError: Why the image has no mask.
        """
        ...

    def told(self, values: Iterable[int]) -> str:
        """Values in the notation of a `recording.toml`."""
        ...


@dataclass(frozen=True)
class Grey:
    """Grey levels, labels, or palette indices."""

    def of(self, image: Shaped[np.ndarray, "h w *channels"]) -> Shaped[np.ndarray, "h w"]:
        """The image itself, or the second channel of a colour image that is grey."""
        if image.ndim == 2:
            return image
        if is_coloured(image):
            raise ValueError("is a picture in colour, not a mask; give it as images or video with a background")
        return np.ascontiguousarray(image[:, :, 0 if image.shape[2] < 3 else 1])

    def told(self, values: Iterable[int]) -> str:
        """Values in ascending order, with runs abbreviated."""
        return told(values)


@dataclass(frozen=True)
class Alpha:
    """The alpha channel."""

    def of(self, image: Shaped[np.ndarray, "h w *channels"]) -> Shaped[np.ndarray, "h w"]:
        """The last of two or four channels."""
        if image.ndim == 2 or image.shape[2] not in (2, 4):
            raise ValueError("has no alpha channel, but others have; write all alike")
        return np.ascontiguousarray(image[:, :, -1])

    def told(self, values: Iterable[int]) -> str:
        """Values in ascending order, with runs abbreviated."""
        return told(values)


@dataclass(frozen=True)
class Colours:
    """Colours as 24-bit numbers: red, then green, then blue, 8 bits each."""

    def of(self, image: Shaped[np.ndarray, "h w *channels"]) -> UInt32[np.ndarray, "h w"]:
        """A number for each pixel's colour."""
        if image.dtype == np.uint16:
            image = (image // 257).astype(np.uint8)
        if image.ndim == 2 or image.shape[2] < 3:
            grey = image if image.ndim == 2 else image[:, :, 0]
            return grey.astype(np.uint32) * 0x010101
        blue, green, red = (channel.astype(np.uint32) for channel in cv2.split(image)[:3])
        return red << 16 | green << 8 | blue

    def told(self, values: Iterable[int]) -> str:
        """Red, green and blue of each colour."""
        return _joined([str([value >> 16, value >> 8 & 255, value & 255]) for value in sorted(values)])


@dataclass(frozen=True)
class Brightest:
    """The brightest channel, for masks in one colour on black."""

    def of(self, image: Shaped[np.ndarray, "h w *channels"]) -> Shaped[np.ndarray, "h w"]:
        """The maximum of red, green and blue."""
        return image if image.ndim == 2 else _brightest(image)

    def told(self, values: Iterable[int]) -> str:
        """Values in ascending order, with runs abbreviated."""
        return told(values)


def is_coloured(image: Shaped[np.ndarray, "h w channels"]) -> bool:
    """Whether more pixels are coloured than codec noise explains."""
    return int(np.count_nonzero(_saturation(image) > _GREY)) > _MOST_COLOURED * image[..., 0].size


def is_painted(image: Shaped[np.ndarray, "h w *channels"]) -> bool:
    """Whether the pixels that are not black are coloured, in an image without lossy compression."""
    if image.ndim == 2:
        return False
    painted = int(np.count_nonzero(_saturation(image) > _PAINTED))
    return painted > 0 and painted > _MOST_PAINTED * int(np.count_nonzero(_brightest(image) > _PAINTED))


# Largest channel difference that colour conversion adds to grey; and largest share of the mask that may be its fringe.
_PAINTED, _MOST_PAINTED = 8, 0.1


def _brightest(image: Shaped[np.ndarray, "h w channels"]) -> Shaped[np.ndarray, "h w"]:
    first, *others = cv2.split(image)[:3]
    for channel in others:
        first = np.maximum(first, channel)
    return first


def _saturation(image: Shaped[np.ndarray, "h w channels"]) -> Shaped[np.ndarray, "h w"]:
    """Difference between the channels, in 8 bits; OpenCV takes a tenth of NumPy's time."""
    if image.dtype == np.uint16:
        image = (image // 257).astype(np.uint8)
    first, *others = cv2.split(image)[: 3 if image.shape[2] > 2 else 1]
    off = np.zeros_like(first)
    for channel in others:
        off = np.maximum(off, cv2.absdiff(first, channel))
    return off


def told(values: Iterable[int]) -> str:
    """Values in ascending order, with runs abbreviated: 0, 2 to 18 and 255."""
    runs: list[list[int]] = []
    for value in sorted(set(values)):
        if runs and value == runs[-1][-1] + 1:
            runs[-1].append(value)
        else:
            runs.append([value])
    parts = [[f"{run[0]} to {run[-1]}"] if len(run) > 2 else [str(value) for value in run] for run in runs]
    return _joined([part for each in parts for part in each])


# Largest number of values or colours that a message lists.
_MOST_TOLD = 12


def _joined(parts: Sequence[str]) -> str:
    if len(parts) > _MOST_TOLD:
        return f"{', '.join(parts[:_MOST_TOLD])} and more"
    return " and ".join(filter(None, [", ".join(parts[:-1]), parts[-1] if parts else ""]))
