"""Images out of files that may come from anywhere: their size is known before memory is taken for their pixels."""

import io
import struct
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Shaped, UInt8
from PIL import Image

from ._bounded import check_pixels, open_regular, read_bounded
from ._errors import fault
from ._image_sizes import NotAnImage, claimed_size, is_gif, is_known, is_lossless, may_be_indexed

# Of the most pixels, uncompressed, in three colours of 8 bits.
_MOST_BYTES = 2**28
_DAMAGED = "is no image that can be read; it is damaged or of another format: write it as PNG of 8 bits"


@dataclass(frozen=True)
class Indexed:
    """An image that holds indices, and the colours that they stand for."""

    indices: UInt8[np.ndarray, "h w"]
    palette: UInt8[np.ndarray, "colours 3"]
    """Red, green and blue; there may be larger indices than colours."""
    opacity: UInt8[np.ndarray, " some"]
    """Of the first colours, how opaque they are; the others are wholly."""


def read_image(path: Path, flags: int = cv2.IMREAD_UNCHANGED) -> Shaped[np.ndarray, "h w *channels"]:
    """An image of 8 or 16 bits, as OpenCV reads it: grey, or blue, green, red, and alpha where there is any.

    Args:
        path: PNG, BMP, TIFF, JPEG, WebP, GIF, PBM, PGM or PPM, by its content.
        flags: OpenCV's, such as `cv2.IMREAD_COLOR`.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    content = _checked(path)
    try:
        # OpenCV reads them since 4.11.
        image = _in_colour(path, content) if is_gif(content) else cv2.imdecode(np.frombuffer(content, np.uint8), flags)
    except cv2.error:
        image = None
    if image is None:
        raise fault(path, None, _DAMAGED)
    if image.dtype not in (np.uint8, np.uint16):
        raise fault(path, None, f"holds pixels of {image.dtype}, which are not read: write it as PNG of 8 or 16 bits")
    return image


def read_indexed(path: Path) -> Indexed | None:
    """An image as the indices of its palette; None where it has none.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    content = _checked(path)
    if not may_be_indexed(content):
        return None
    image = _opened(path, content)
    if image.mode != "P":
        return None
    indices = np.asarray(_loaded(path, image))
    return Indexed(
        indices,
        np.array(image.getpalette("RGB") or [], np.uint8).reshape(-1, 3),
        _opacity(image.info.get("transparency")),
    )


def _opacity(transparent: Any) -> UInt8[np.ndarray, " some"]:
    """Pillow gives a byte for each of the first colours, or the number of the only one that is transparent."""
    if isinstance(transparent, int):
        return np.array([255] * transparent + [0], np.uint8)
    return np.frombuffer(transparent if isinstance(transparent, bytes) else b"", np.uint8)


def keeps_values(path: Path) -> bool:
    """Whether an image's pixels are as they were written: not so in a JPEG.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    return is_lossless(_checked(path))


def is_picture(path: Path) -> bool:
    """Whether a file begins as the images do that are read here."""
    try:
        with open_regular(path) as file:
            return is_known(file.read(12) or b"")
    except (ValueError, OSError):
        return False


def _checked(path: Path) -> bytes:
    """The content of a file whose header claims no more pixels than are read."""
    content = read_bounded(path, _MOST_BYTES, "an image")
    try:
        width, height = claimed_size(content)
    except NotAnImage as error:
        raise fault(path, None, str(error) or _DAMAGED) from None
    except (struct.error, OverflowError):
        raise fault(path, None, _DAMAGED) from None
    check_pixels(path, width, height)
    return content


def _opened(path: Path, content: bytes) -> Image.Image:
    """An image whose header Pillow has read, no larger than OpenCV's would be."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            image = Image.open(io.BytesIO(content), formats=("PNG", "BMP", "TIFF", "GIF"))
        except Exception:  # Pillow raises a dozen kinds on hostile bytes
            raise fault(path, None, _DAMAGED) from None
    check_pixels(path, *image.size)
    return image


def _loaded(path: Path, image: Image.Image) -> Image.Image:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            image.load()
        except Exception:
            raise fault(path, None, _DAMAGED) from None
    return image


def _in_colour(path: Path, content: bytes) -> UInt8[np.ndarray, "h w 3"]:
    image = _opened(path, content)
    if getattr(image, "is_animated", False):
        raise fault(path, None, "holds several images: write each to a file of its own, or a video")
    return np.ascontiguousarray(np.asarray(_loaded(path, image).convert("RGB"))[..., ::-1])
