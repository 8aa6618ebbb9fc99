"""Images as a video file."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from ..files import fault, grab, opened, retrieve, size_of

VIDEO_SUFFIXES = (".avi", ".mp4", ".mov", ".mkv", ".m4v", ".webm", ".mpg", ".mpeg", ".wmv")
_MOST_FRAMES = 10_000_000  # a day at 100 frames a second: a header that claims more is damaged
# Codec codes that keep values exactly, at least without chroma subsampling.
_LOSSLESS = (b"FFV1", b"HFYU", b"FFVH", b"LAGS", b"MPNG", b"PNG ", b"DIB ", b"BGR\x18", bytes(4))


class Video:
    """Frames of a video, numbered from 0."""

    def __init__(self, path: Path):
        """Open the file and count its frames.

        Raises:
            ValueError: One line, if the file is no video.
        """
        self.path = path
        self._capture = opened(path)
        self._next = 0
        self._last_image = None
        self.size = size_of(self._capture)
        rate = self._capture.get(cv2.CAP_PROP_FPS)
        self.fps = float(rate) if np.isfinite(rate) and 0 < rate < 1e5 else None
        claimed = self._capture.get(cv2.CAP_PROP_FRAME_COUNT)
        count = int(claimed) if 0 < claimed < _MOST_FRAMES and self._has(int(claimed) - 1) else self._counted()
        if count == 0 or min(self.size) < 1:
            raise fault(path, None, "holds no frame that can be read; it is damaged or cut short: write it again")
        self.span = 0, count - 1

    @property
    def notes(self) -> tuple[str, ...]:
        """Empty: frames of a video need no notes."""
        return ()

    @property
    def numbers(self) -> range:
        """Numbers of all frames, from 0."""
        return range(self.span[1] + 1)

    def keeps_values(self) -> bool:
        """Whether the codec keeps values exactly."""
        code = int(self._capture.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF
        return code.to_bytes(4, "little").upper() in _LOSSLESS

    def named(self, number: int) -> str:
        """The frame's number, for messages."""
        return f"frame {number}"

    def glimpses(self) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
        """Frames near the end, the beginning and the middle, those that can be read."""
        image, self._last_image = self._last_image, None
        if image is not None:
            yield image
        try:
            for number in (0, self.span[1] // 2):
                image = retrieve(self._capture) if self._sought(number) else None
                if image is not None and image.shape[1::-1] == self.size:
                    yield image
        finally:
            self._restart()

    def read(self, number: int) -> UInt8[np.ndarray, "h w 3"] | None:
        """Read a frame as blue, green, red; None outside of the video.

        Raises:
            ValueError: The video breaks off, or changes its size.
        """
        if not 0 <= number <= self.span[1]:
            return None
        if number < self._next:
            self._restart()
        # With some codecs, seeking lands on another frame, so read all frames in order.
        while self._next < number and grab(self._capture):
            self._next += 1
        image = retrieve(self._capture) if self._next == number and grab(self._capture) else None
        if image is None:
            raise fault(self.path, None, f"breaks off at frame {self._next} of {self.span[1] + 1}; write it again")
        self._next += 1
        height, width = image.shape[:2]
        if (width, height) != self.size:
            raise fault(self.path, None, f"changes its size to {width} x {height} px at frame {number}")
        return image

    def _restart(self) -> None:
        self._capture.release()
        self._capture, self._next = opened(self.path), 0

    def _has(self, last: int) -> bool:
        """Whether the last frame exists: headers are written before the frames, and some claim too many."""
        there = self._sought(last)
        if there:
            image = retrieve(self._capture)
            self._last_image = image if image is not None and image.shape[1::-1] == self.size else None
        self._restart()
        return there

    def _sought(self, number: int) -> bool:
        """Seek to a frame; with some codecs this lands on a frame near it."""
        try:
            self._capture.set(cv2.CAP_PROP_POS_FRAMES, number)
        except cv2.error:
            return False
        return grab(self._capture)

    def _counted(self) -> int:
        count = 0
        while count < _MOST_FRAMES and grab(self._capture):
            count += 1
        self._restart()
        return count
