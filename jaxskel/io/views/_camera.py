"""Images that come while they are taken: a camera at this machine, a stream from the network, or a file."""

from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import cv2
import numpy as np
from jaxtyping import UInt8

from ..files import check_pixels, grab, opened, retrieve

# A camera in the network that is silent for longer (ms) is given up.
_OPEN_TIMEOUT, _READ_TIMEOUT = 10_000, 5_000
# Images from which a background may be learned before the session.
_FIRST = 10


def is_camera(value: object) -> bool:
    """Whether a value names a camera: a number (0 is the first one), a device, or an address such as ``rtsp://...``."""
    if isinstance(value, str):
        return "://" in value or value.startswith("/dev/")
    return type(value) is int and value >= 0


class Camera:
    """A [`Frames`][] whose images come one after the other and are read once, in the order in which they come.

    A file is read from its beginning; ``file:///...`` is one, too.

    Raises:
        ValueError: It cannot be opened, or gives no image; what is wrong with it, to which the caller adds its name.
    """

    notes: tuple[str, ...] = ()

    def __init__(self, value: int | str | Path):
        self._file: Path | None = None
        if isinstance(value, Path):
            self._file = value
        elif isinstance(value, str) and value.startswith("file://"):
            self._file = Path(url2pathname(urlsplit(value).path))  # on Windows it begins with a drive
        self._value = value
        self.path = Path(str(value)) if self._file is None else self._file
        self._capture = self._opened()
        self._first = self._next()
        if self._first is None:
            raise ValueError("gives no image; is the camera used by another program?")
        height, width = self._first.shape[:2]
        check_pixels(self.path, width, height)
        self.size = width, height
        self.span = 0, _FIRST - 1
        rate = self._capture.get(cv2.CAP_PROP_FPS)
        self.fps = float(rate) if np.isfinite(rate) and 0 < rate < 1e5 else None

    @property
    def is_file(self) -> bool:
        """Whether images are there at once, so that whoever reads them keeps to the rate."""
        return self._file is not None

    @property
    def numbers(self) -> range:
        """Numbers of the first images."""
        return range(_FIRST)

    def keeps_values(self) -> bool:
        """False: cameras give colours."""
        return False

    def named(self, number: int) -> str:
        """The image's number, for messages."""
        return f"image {number}"

    def read(self, number: int) -> UInt8[np.ndarray, "h w 3"] | None:
        """The next image, whatever its number; None if none comes."""
        first, self._first = self._first, None
        return self._next() if first is None else first

    def grab(self) -> bool:
        """Wait for the next image; False if no more comes."""
        return grab(self._capture)

    def retrieve(self) -> UInt8[np.ndarray, "h w 3"] | None:
        """Decode the image that was grabbed; None if it is damaged or has another size than the others."""
        image = retrieve(self._capture)
        return image if image is not None and image.shape[1::-1] == self.size else None

    def restart(self) -> None:
        """Open it again: a file begins anew, and what a camera has sent long ago is forgotten.

        Raises:
            ValueError: It cannot be opened any more.
        """
        self._first = None
        self._capture.release()
        self._capture = self._opened()

    def close(self) -> None:
        """Let go of the camera."""
        self._capture.release()

    def _next(self) -> UInt8[np.ndarray, "h w 3"] | None:
        return retrieve(self._capture) if grab(self._capture) else None

    def _opened(self) -> cv2.VideoCapture:
        if self._file is not None:
            return opened(self._file)
        try:
            if isinstance(self._value, str) and "://" in self._value:
                capture = cv2.VideoCapture(
                    self._value, cv2.CAP_FFMPEG,
                    [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, _OPEN_TIMEOUT, cv2.CAP_PROP_READ_TIMEOUT_MSEC, _READ_TIMEOUT],
                )  # fmt: skip
            else:
                capture = cv2.VideoCapture(self._value)  # pyright: ignore[reportArgumentType]  (a number or a text)
        except cv2.error:
            capture = None
        if capture is None or not capture.isOpened():
            raise ValueError("cannot be opened; is the camera there, and used by no other program?")
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)  # where it is possible: old images are of no use
        return capture
