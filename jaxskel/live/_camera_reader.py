"""Reads one camera in a thread, and keeps the last images only."""

from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from threading import Condition, Thread

import numpy as np
from jaxtyping import UInt8

from ..io.views import Camera
from ._clock import Clock

# Rate of files that do not state one (frames per second).
_USUAL = 25.0
# Images of a camera that wait take no more memory: ten HD images.
_MOST_BYTES = 64_000_000


@dataclass(frozen=True)
class Image:
    """An image of one camera.

    Attributes:
        number: Counts the camera's images from 0, also those that nobody asked for.
        time: When it came (s).
    """

    number: int
    time: float
    pixels: UInt8[np.ndarray, "h w 3"]


class CameraReader:
    """A thread that reads a camera until it ends or is told to.

    A camera gives images when it has them. Those of a file are there at once, so the thread waits for the time of each.

    Args:
        camera: What is read, and closed at the end.
        clock: The session's clock.
        arrived: Notified of each image; its lock protects what is read here.
        start: When the first image of a file is due (s).
        most: Largest number of images that wait to be taken; older ones are dropped. Large images are fewer.
    """

    def __init__(self, camera: Camera, clock: Clock, arrived: Condition, start: float, most: int):
        self._camera, self._clock, self._arrived, self._start = camera, clock, arrived, start
        self._closing = False
        width, height = camera.size
        self.waiting: deque[Image] = deque(maxlen=max(1, min(most, _MOST_BYTES // (3 * width * height))))
        """Images that nobody has taken, the newest last."""
        self.last_time = start
        """When the last image came (s)."""
        self.ended = False
        """Whether no more images come."""
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self, longest: float) -> None:
        """End the thread, unless the camera keeps it waiting for longer (s)."""
        self._closing = True
        self._thread.join(longest)

    def _run(self) -> None:
        camera, number = self._camera, 0
        interval = 1.0 / (camera.fps or _USUAL)
        try:
            with suppress(ValueError):  # it is gone again
                camera.restart()
            while not self._closing and not self._clock.stopped():
                late = self._clock.now() - self._start - number * interval
                if camera.is_file and late < 0:
                    self._clock.sleep(-late)
                if not camera.grab():
                    break
                # Decoding a file may take too long for its rate.
                skipped = camera.is_file and late > interval
                pixels = None if skipped else camera.retrieve()
                if pixels is not None:
                    with self._arrived:
                        self.last_time = self._clock.now()
                        self.waiting.append(Image(number, self.last_time, pixels))
                        self._arrived.notify_all()
                number += 1
        finally:
            camera.close()
            with self._arrived:
                self.ended = True
                self._arrived.notify_all()
