"""Sizes of images, as their headers claim them."""

import re
import struct
from collections.abc import Callable, Iterator

# TIFF tags that decide the size of the image or its tiles, and of a pixel.
_WIDTHS, _HEIGHTS, _BITS = (256, 322), (257, 323), 258
_TIFF_TYPES = {1: "B", 3: "H", 4: "I", 16: "Q"}
# Largest number of scans of a progressive JPEG; a usual one has a dozen. Each scan decodes the whole image, however few
# bytes it has.
_MOST_SCANS = 100


class NotAnImage(Exception):
    """The file is not an image of a known format; the text says why, if that is known."""


def claimed_size(content: bytes) -> tuple[int, int]:
    """Width and height (px) that a header claims; the largest if there are several claims.

    Raises:
        NotAnImage: The content is no known image. A truncated header may also raise `struct.error` and `OverflowError`.
    """
    for start, size in _SIZES.items():
        if content.startswith(start):
            return size(content)
    raise NotAnImage


def is_known(start: bytes) -> bool:
    """Whether a file with these first 12 bytes has a known format."""
    # AVI files are RIFF files too.
    return start.startswith(tuple(_SIZES)) and (not start.startswith(_RIFF) or start[8:12] == b"WEBP")


def may_be_indexed(content: bytes) -> bool:
    """Whether an image may hold palette indices."""
    if content.startswith(_PNG):
        return content[25:26] == b"\x03"
    if content.startswith(_BMP):
        return content[28:29] in (b"\x01", b"\x04", b"\x08")
    return content.startswith((*_TIFF, *_GIF))


def is_gif(content: bytes) -> bool:
    """Whether an image is a GIF."""
    return content.startswith(_GIF)


def is_lossless(content: bytes) -> bool:
    """Whether the format keeps pixel values exactly, so that labels and sharp edges survive."""
    if content.startswith(_RIFF):
        return any(kind == b"VP8L" for kind, _ in _webp_chunks(content))
    return not content.startswith(_JPEG)


def _size_of_png(content: bytes) -> tuple[int, int]:
    place, kind = len(_PNG), b""
    # OpenCV allocates as much as a chunk claims.
    while kind != b"IEND":
        length, kind = struct.unpack_from(">I4s", content, place)
        place += 12 + length
        if place > len(content):
            raise NotAnImage
    return struct.unpack_from(">II", content, 16)


def _size_of_jpeg(content: bytes) -> tuple[int, int]:
    if content.count(b"\xff\xda") > _MOST_SCANS:
        raise NotAnImage
    place = 2
    # Decoders skip bytes between the segments.
    while (marker := re.compile(rb"\xff+([^\x00\xff])").search(content, place)) is not None:
        kind, place = marker[1][0], marker.end()
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", content, place + 3)
            return width, height
        if kind != 0x01 and not 0xD0 <= kind <= 0xD7:  # these markers have no length
            place += struct.unpack_from(">H", content, place)[0]
    raise NotAnImage


def _size_of_tiff(content: bytes) -> tuple[int, int]:
    """Width and height (px) of the first image, or of its tiles if larger, since decoding allocates whole tiles."""
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
            raise NotAnImage
        form = order + _TIFF_TYPES[kind]
        (given,) = struct.unpack_from(order + number, content, place + 4)
        at = place + entry - struct.calcsize(number)
        if given * struct.calcsize(form) > struct.calcsize(number):
            (at,) = struct.unpack_from(order + number, content, at)
        (value,) = struct.unpack_from(form, content, at)
        width = max(width, value) if tag in _WIDTHS else width
        height = max(height, value) if tag in _HEIGHTS else height
        if tag == _BITS and value > 16:
            raise NotAnImage(f"has {value} bits a pixel, which are not read: write it as PNG of 8 or 16 bits")
    return width, height


def _size_of_bmp(content: bytes) -> tuple[int, int]:
    is_old = struct.unpack_from("<I", content, 14)[0] == 12
    width, height = struct.unpack_from("<HH" if is_old else "<ii", content, 18)
    return abs(width), abs(height)


def _size_of_webp(content: bytes) -> tuple[int, int]:
    """The larger of canvas and image (px): https://developers.google.com/speed/webp/docs/riff_container."""
    width, height = 0, 0
    for kind, place in _webp_chunks(content):
        if kind == b"ANIM":
            raise NotAnImage("holds several images: write each to a file of its own")
        if kind == b"VP8X":
            both = int.from_bytes(content[place + 4 : place + 10], "little")
            w, h = 1 + (both & 0xFFFFFF), 1 + (both >> 24)
        elif kind == b"VP8L":
            bits = struct.unpack_from("<I", content, place + 1)[0]
            w, h = 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
        elif kind == b"VP8 ":
            w, h = (side & 0x3FFF for side in struct.unpack_from("<HH", content, place + 6))
        else:
            continue
        width, height = max(width, w), max(height, h)
    return width, height


def _webp_chunks(content: bytes) -> Iterator[tuple[bytes, int]]:
    """The kind of each chunk, and the offset of its content."""
    if content[8:12] != b"WEBP":
        raise NotAnImage
    place = 12
    while place + 8 <= len(content):
        kind, length = struct.unpack_from("<4sI", content, place)
        yield kind, place + 8
        place += 8 + length + length % 2


def _size_of_pnm(content: bytes) -> tuple[int, int]:
    """Size (px) of PBM, PGM and PPM, in text or binary form: https://netpbm.sourceforge.net/doc/pnm.html."""
    header = re.match(rb"P[1-6](?:\s|#[^\n]*\n)+(\d{1,9})(?:\s|#[^\n]*\n)+(\d{1,9})\s", content[:4000])
    if header is None:
        raise NotAnImage
    return int(header[1]), int(header[2])


def _size_of_gif(content: bytes) -> tuple[int, int]:
    """Size (px) of the screen on which its images are drawn."""
    return struct.unpack_from("<HH", content, 6)


_PNG, _BMP, _JPEG, _RIFF = b"\x89PNG\r\n\x1a\n", b"BM", b"\xff\xd8", b"RIFF"
_TIFF, _GIF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"), (b"GIF87a", b"GIF89a")
_PNM = tuple(b"P%d" % kind for kind in range(1, 7))
_SIZES: dict[bytes, Callable[[bytes], tuple[int, int]]] = {
    _PNG: _size_of_png,
    _BMP: _size_of_bmp,
    _JPEG: _size_of_jpeg,
    _RIFF: _size_of_webp,
    **dict.fromkeys(_TIFF, _size_of_tiff),
    **dict.fromkeys(_GIF, _size_of_gif),
    **dict.fromkeys(_PNM, _size_of_pnm),
}
