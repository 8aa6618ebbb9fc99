"""Writing of image files: atomically, with a note in PNGs that jaxskel made them."""

import io
import struct
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from jaxtyping import UInt8

from .atomic_files import written_whole

if TYPE_CHECKING:  # Matplotlib takes a second to import, and only some commands need it
    from matplotlib.figure import Figure

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")
"""Suffixes of the files that `write_image` can write."""
SIGNATURE = b"tEXtSoftware\0jaxskel"
"""Text chunk in a PNG that names this program as its maker."""


def write_image(path: str | Path, image: UInt8[np.ndarray, "h w 3"]) -> None:
    """Write an image (blue, green, red); the suffix of the path gives the format.

    Raises:
        ValueError: The suffix is of no known format.
    """
    path = Path(path)
    try:
        done, content = cv2.imencode(path.suffix, image)
    except cv2.error:
        done, content = False, np.zeros(0, np.uint8)
    if not done:
        raise ValueError(f"{path}: the picture cannot be written; give a name that ends in .png or .jpg")
    _write(path, content.tobytes())


def write_figure(path: str | Path, figure: "Figure", dpi: int) -> None:
    """Write a Matplotlib figure; the suffix of the path gives the format (.png, .pdf, .svg).

    Raises:
        ValueError: The suffix is of no known format.
    """
    path, content = Path(path), io.BytesIO()
    figure.savefig(content, dpi=dpi, format=path.suffix.removeprefix(".") or "png")
    _write(path, content.getvalue())


def _write(path: Path, content: bytes) -> None:
    with written_whole(path) as file:
        file.write(_signed(content) if content.startswith(b"\x89PNG") else content)


def _signed(png: bytes) -> bytes:
    """The PNG with the signature as a text chunk after its header."""
    header = 8 + 12 + struct.unpack(">I", png[8:12])[0]
    length, check = struct.pack(">I", len(SIGNATURE) - 4), struct.pack(">I", zlib.crc32(SIGNATURE))
    return png[:header] + length + SIGNATURE + check + png[header:]
