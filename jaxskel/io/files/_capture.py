"""Opens untrusted videos: their headers are checked before a frame is decoded."""

import re
import struct
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from ._bounded import check_pixels, check_regular, open_regular
from ._errors import fault

# Boxes of an MP4 or MOV that state a number of samples without a byte for each.
_COUNTS = re.compile(rb"stsz.{8}(.{4})|trun.{4}(.{4})", re.DOTALL)
# A compressed header, which no program has written for decades, expands to a thousand times its size.
_PACKED = b"cmvd"
# Largest header that is read (bytes): that of a video of a day is smaller.
_HEADER = 64_000_000


def opened(path: Path) -> cv2.VideoCapture:
    """Open a video, positioned before its first frame.

    Raises:
        ValueError: One line, if the file is no video, or claims sizes that would fill the memory.
    """
    check_regular(path)
    try:
        _check_counts(path)
        capture = cv2.VideoCapture(str(path))
    except (OSError, cv2.error):
        capture = None
    if capture is None or not capture.isOpened():
        raise fault(path, None, "is no video that can be read; re-encode it, for instance as H.264 in .mp4")
    check_pixels(path, *size_of(capture))
    return capture


def size_of(capture: cv2.VideoCapture) -> tuple[int, int]:
    """Width and height of a video's frames (px)."""
    return int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))


def grab(capture: cv2.VideoCapture) -> bool:
    """Advance to the next frame and return whether one could be read; on hostile bytes OpenCV raises."""
    try:
        return capture.grab()
    except cv2.error:
        return False


def retrieve(capture: cv2.VideoCapture) -> UInt8[np.ndarray, "h w 3"] | None:
    """Decode the frame last grabbed; None if that fails."""
    try:
        there, image = capture.retrieve()
    except cv2.error:
        return None
    return np.asarray(image) if there and image is not None else None


def _check_counts(path: Path) -> None:
    """Refuse an MP4 or MOV that claims more samples than bytes: FFmpeg allocates for what is claimed."""
    length, place = path.stat().st_size, 0
    with open_regular(path) as file:
        while place + 8 <= length:
            file.seek(place)
            size, kind = struct.unpack(">I4s", file.read(8))
            begin = place + 8
            if size == 1:
                (size,) = struct.unpack(">Q", file.read(8).ljust(8, b"\0"))
                begin += 8
            # The box reaches to the end of the file: stated so, or truncated, or the file has another format.
            stop = length if size < 8 or place + size > length else place + size
            if kind != b"mdat" and kind.isalpha() and kind.islower():
                _check_header(path, file.read(min(stop - begin, _HEADER)), length)
            place = stop


def _check_header(path: Path, header: bytes, length: int) -> None:
    if _PACKED in header:
        raise fault(path, None, "has a packed header, which is not read; re-encode it, for instance as H.264 in .mp4")
    for found in _COUNTS.finditer(header):
        (claimed,) = struct.unpack(">I", found[1] or found[2])
        if claimed > length:
            raise fault(path, None, f"claims {claimed} frames in {length} bytes; it is damaged, write it again")
