"""Which of an image's channels are a mask, and what values there are in it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from jaxtyping import Shaped, UInt32

# Numbers of parts or of people in one camera's masks; where there are more values, it is a picture.
MOST_VALUES = 64
# Channels of a grey image differ by what a video codec does to them, at most.
_GREY = 48
_MOST_COLOURED = 0.01


@runtime_checkable
class Values(Protocol):
    """Takes a mask out of an image."""

    def of(self, image: Shaped[np.ndarray, "h w *channels"]) -> Shaped[np.ndarray, "h w"]:
        """A number for each pixel.

        Raises:
            ValueError: Why the image has none.
        """
        ...

    def told(self, values: Iterable[int]) -> str:
        """Values, as a person would name them in a `recording.toml`."""
        ...


@dataclass(frozen=True)
class Grey:
    """Grey levels, labels, or indices of a palette."""

    def of(self, image: Shaped[np.ndarray, "h w *channels"]) -> Shaped[np.ndarray, "h w"]:
        """The image, or of one in colours that are all grey, its second channel."""
        if image.ndim == 2:
            return image
        if is_coloured(image):
            raise ValueError("is a picture in colour, not a mask; give it as images or video with a background")
        return np.ascontiguousarray(image[:, :, 0 if image.shape[2] < 3 else 1])

    def told(self, values: Iterable[int]) -> str:
        """Runs of numbers in short."""
        return told(values)


@dataclass(frozen=True)
class Alpha:
    """How opaque a pixel is."""

    def of(self, image: Shaped[np.ndarray, "h w *channels"]) -> Shaped[np.ndarray, "h w"]:
        """The last of two or four channels."""
        if image.ndim == 2 or image.shape[2] not in (2, 4):
            raise ValueError("has no alpha channel, but others have; write all alike")
        return np.ascontiguousarray(image[:, :, -1])

    def told(self, values: Iterable[int]) -> str:
        """Runs of numbers in short."""
        return told(values)


@dataclass(frozen=True)
class Colours:
    """Colours as numbers: red, then green, then blue, 8 bits each."""

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
        """Red, green and blue of each."""
        return _joined([str([value >> 16, value >> 8 & 255, value & 255]) for value in sorted(values)])


@dataclass(frozen=True)
class Brightest:
    """The brightest of the channels, of masks in one colour on black."""

    def of(self, image: Shaped[np.ndarray, "h w *channels"]) -> Shaped[np.ndarray, "h w"]:
        """The largest of red, green and blue."""
        return image if image.ndim == 2 else _brightest(image)

    def told(self, values: Iterable[int]) -> str:
        """Runs of numbers in short."""
        return told(values)


def is_coloured(image: Shaped[np.ndarray, "h w channels"]) -> bool:
    """Whether more than a codec's noise is in colour."""
    return int(np.count_nonzero(_saturation(image) > _GREY)) > _MOST_COLOURED * image[..., 0].size


def is_painted(image: Shaped[np.ndarray, "h w *channels"]) -> bool:
    """Whether what is not black is in colour, in an image that no codec has changed."""
    if image.ndim == 2:
        return False
    painted = int(np.count_nonzero(_saturation(image) > _PAINTED))
    return painted > 0 and painted > _MOST_PAINTED * int(np.count_nonzero(_brightest(image) > _PAINTED))


# What a conversion between kinds of colour does to grey, at most; and a part of the mask that may be its fringe.
_PAINTED, _MOST_PAINTED = 8, 0.1


def _brightest(image: Shaped[np.ndarray, "h w channels"]) -> Shaped[np.ndarray, "h w"]:
    first, *others = cv2.split(image)[:3]
    for channel in others:
        first = np.maximum(first, channel)
    return first


def _saturation(image: Shaped[np.ndarray, "h w channels"]) -> Shaped[np.ndarray, "h w"]:
    """How much the channels differ, in 8 bits; by OpenCV, which takes a tenth of NumPy's time."""
    if image.dtype == np.uint16:
        image = (image // 257).astype(np.uint8)
    first, *others = cv2.split(image)[: 3 if image.shape[2] > 2 else 1]
    off = np.zeros_like(first)
    for channel in others:
        off = np.maximum(off, cv2.absdiff(first, channel))
    return off


def told(values: Iterable[int]) -> str:
    """Numbers in ascending order, runs of them in short: 0, 2 to 18 and 255."""
    runs: list[list[int]] = []
    for value in sorted(set(values)):
        if runs and value == runs[-1][-1] + 1:
            runs[-1].append(value)
        else:
            runs.append([value])
    parts = [[f"{run[0]} to {run[-1]}"] if len(run) > 2 else [str(value) for value in run] for run in runs]
    return _joined([part for each in parts for part in each])


# So many values or colours are named in a message.
_MOST_TOLD = 12


def _joined(parts: Sequence[str]) -> str:
    if len(parts) > _MOST_TOLD:
        return f"{', '.join(parts[:_MOST_TOLD])} and more"
    return " and ".join(filter(None, [", ".join(parts[:-1]), parts[-1] if parts else ""]))
