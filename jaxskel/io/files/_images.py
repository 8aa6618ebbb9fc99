"""Reads untrusted images: their size is checked before memory is allocated for their pixels."""

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

# Largest file: the most pixels that are allowed, uncompressed, in three colours of 8 bits.
_MOST_BYTES = 2**28
_DAMAGED = "is no image that can be read; it is damaged or of another format: write it as PNG of 8 bits"


@dataclass(frozen=True)
class Indexed:
    """An image of palette indices, and the colours that they stand for.

    Attributes:
        palette: Red, green and blue; indices may exceed the number of colours.
        opacity: Opacity of the first colours; all others are opaque.
    """

    indices: UInt8[np.ndarray, "h w"]
    palette: UInt8[np.ndarray, "colours 3"]
    opacity: UInt8[np.ndarray, " some"]


def read_image(path: Path, flags: int = cv2.IMREAD_UNCHANGED) -> Shaped[np.ndarray, "h w *channels"]:
    """Read an image of 8 or 16 bits with OpenCV's channels: grey, or blue, green, red, and alpha if present.

    Args:
        path: PNG, BMP, TIFF, JPEG, WebP, GIF, PBM, PGM or PPM file, recognised by its content.
        flags: OpenCV's, such as `cv2.IMREAD_COLOR`.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    content = _checked(path)
    try:
        # OpenCV reads GIF only since 4.11.
        image = _in_colour(path, content) if is_gif(content) else cv2.imdecode(np.frombuffer(content, np.uint8), flags)
    except cv2.error:
        image = None
    if image is None:
        raise fault(path, None, _DAMAGED)
    if image.dtype not in (np.uint8, np.uint16):
        raise fault(path, None, f"holds pixels of {image.dtype}, which are not read: write it as PNG of 8 or 16 bits")
    return image


def read_indexed(path: Path) -> Indexed | None:
    """Read an image as its palette indices; None if it has no palette.

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
    """Opacity of the first colours; Pillow gives a byte for each, or the index of the only transparent colour."""
    if isinstance(transparent, int):
        return np.array([255] * transparent + [0], np.uint8)
    return np.frombuffer(transparent if isinstance(transparent, bytes) else b"", np.uint8)


def keeps_values(path: Path) -> bool:
    """Whether the image format keeps pixel values exactly, unlike JPEG.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    return is_lossless(_checked(path))


def is_picture(path: Path) -> bool:
    """Whether the first bytes of a file are those of a readable image format."""
    try:
        with open_regular(path) as file:
            return is_known(file.read(12) or b"")
    except (ValueError, OSError):
        return False


def _checked(path: Path) -> bytes:
    """The content of a file whose header claims no more pixels than allowed."""
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
    """An image opened by Pillow, whose size is checked as for OpenCV."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            image = Image.open(io.BytesIO(content), formats=("PNG", "BMP", "TIFF", "GIF"))
        except Exception:  # Pillow raises a dozen kinds of exception on hostile bytes
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
