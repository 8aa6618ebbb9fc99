"""Images out of files that may come from anywhere: their size is known before memory is taken for their pixels."""

import re
import struct
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Shaped

from ._archive import fault
from ._bounded import check_pixels, open_regular, read_bounded

# Of the most pixels, uncompressed, in three colours of 8 bits.
_MOST_BYTES = 2**28
# What decides how large a TIFF's image is, or its tiles, and a pixel of them.
_WIDTHS, _HEIGHTS, _BITS = (256, 322), (257, 323), 258
_TIFF_TYPES = {1: "B", 3: "H", 4: "I", 16: "Q"}
# A progressive JPEG is a dozen scans; each goes through all of the image, however few bytes it has.
_MOST_SCANS = 100


def read_image(path: Path, flags: int = cv2.IMREAD_UNCHANGED) -> Shaped[np.ndarray, "h w *channels"]:
    """An image of 8 or 16 bits, as OpenCV reads it: grey, or blue, green, red, and alpha where there is any.

    Args:
        path: PNG, BMP, TIFF or JPEG, by its content.
        flags: OpenCV's, such as `cv2.IMREAD_COLOR`.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    content = read_bounded(path, _MOST_BYTES, "an image")
    try:
        width, height = _size(content)
        check_pixels(path, width, height)
        image = cv2.imdecode(np.frombuffer(content, np.uint8), flags)
    except (_NotAnImage, struct.error, OverflowError, cv2.error):
        image = None
    if image is None or image.dtype not in (np.uint8, np.uint16):
        raise fault(
            path, None, "is no image that can be read; it is damaged or of another format: write it as PNG of 8 bits"
        )
    return image


def is_picture(path: Path) -> bool:
    """Whether a file begins as the images do that are read here."""
    try:
        with open_regular(path) as file:
            start = file.read(8)
    except (ValueError, OSError):
        return False
    return (start or b"").startswith(_STARTS)


class _NotAnImage(Exception):
    pass


def _size(content: bytes) -> tuple[int, int]:
    """Width and height (px) that a header claims; of several claims, the largest."""
    if content.startswith(_PNG):
        return _size_of_png(content)
    if content.startswith(_BMP):
        is_old = struct.unpack_from("<I", content, 14)[0] == 12
        width, height = struct.unpack_from("<HH" if is_old else "<ii", content, 18)
        return abs(width), abs(height)
    if content.startswith(_JPEG):
        return _size_of_jpeg(content)
    if content.startswith(_TIFF):
        return _size_of_tiff(content)
    raise _NotAnImage


_PNG, _BMP, _JPEG = b"\x89PNG\r\n\x1a\n", b"BM", b"\xff\xd8"
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_STARTS = (_PNG, _BMP, _JPEG, *_TIFF)


def _size_of_png(content: bytes) -> tuple[int, int]:
    place, kind = len(_PNG), b""
    # OpenCV takes memory for as much as a chunk claims.
    while kind != b"IEND":
        length, kind = struct.unpack_from(">I4s", content, place)
        place += 12 + length
        if place > len(content):
            raise _NotAnImage
    return struct.unpack_from(">II", content, 16)


def _size_of_jpeg(content: bytes) -> tuple[int, int]:
    if content.count(b"\xff\xda") > _MOST_SCANS:
        raise _NotAnImage
    place = 2
    # Decoders skip what stands between the segments.
    while (marker := re.compile(rb"\xff+([^\x00\xff])").search(content, place)) is not None:
        kind, place = marker[1][0], marker.end()
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", content, place + 3)
            return width, height
        if kind != 0x01 and not 0xD0 <= kind <= 0xD7:  # these two stand alone
            place += struct.unpack_from(">H", content, place)[0]
    raise _NotAnImage


def _size_of_tiff(content: bytes) -> tuple[int, int]:
    """Of the first image: the larger of itself and its tiles, into which it is decoded."""
    order, is_big = "<>"[content[0] == ord("M")], 43 in content[2:4]
    number, count, entry = ("Q", "Q", 20) if is_big else ("I", "H", 12)
    (first,) = struct.unpack_from(order + number, content, 8 if is_big else 4)
    (entries,) = struct.unpack_from(order + count, content, first)
    first += struct.calcsize(count)
    width, height = 0, 0
    for place in range(first, first + entries * entry, entry):
        tag, kind = struct.unpack_from(order + "HH", content, place)
        if tag not in (*_WIDTHS, *_HEIGHTS, _BITS):
            continue
        if kind not in _TIFF_TYPES:
            raise _NotAnImage
        form = order + _TIFF_TYPES[kind]
        (given,) = struct.unpack_from(order + number, content, place + 4)
        at = place + entry - struct.calcsize(number)
        if given * struct.calcsize(form) > struct.calcsize(number):
            (at,) = struct.unpack_from(order + number, content, at)
        (value,) = struct.unpack_from(form, content, at)
        width = max(width, value) if tag in _WIDTHS else width
        height = max(height, value) if tag in _HEIGHTS else height
        if tag == _BITS and value > 16:
            raise _NotAnImage
    return width, height
