"""Frames of running cameras: what all see at one time, cut out of its background."""

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from threading import Condition
from typing import cast

import numpy as np
from jaxtyping import UInt8

from .._runtime.cores import usable_cores
from ..io.files import fault
from ..io.recordings import Rig
from ..io.views import Camera, View
from ._camera_reader import CameraReader, Image
from ._clock import Clock
from ._source import LONGEST, Taken, to_drop

# A camera without an image for this long (s) is a black view until it has one again.
_SILENT = 1.0
# Intervals between frames after which a frame is taken without the new images of some cameras: they keep their last.
_LATE = 1.5
_LOOK_UP = 0.02  # s, after which is looked whether a camera is late, or the session ended
_TO_END = 1.0  # s for a camera to let go


class Captures:
    """Takes a frame whenever all cameras have a new image. A [`Source`][].

    Cameras run freely; what they see at one time should be sent by them at one time. Images that come while a frame is
    being worked on wait for a moment, see [`to_drop`][]. A camera that gives no more images is a black view. The
    frames end when no camera is left.

    Args:
        rig: The cameras, see [`read_rig`][jaxskel.io.recordings.read_rig]; they are closed at the end of the frames.
        tell: Gets a line when a camera falls silent, comes back or ends.
        seconds: Ends after this time, if given.

    Raises:
        ValueError: The images of a view do not fit its background.
    """

    def __init__(self, rig: Rig, tell: Callable[[str], None], seconds: float | None = None):
        self.rig = rig.facts
        self._views, self._tell = rig.views, tell
        self._end = None if seconds is None else max(1, round(seconds * self.rig.fps))
        for view in self._views:
            image = view.frames.read(0)
            if image is not None:
                self._bits(view, image)
            # Until the session begins, programs may compile for minutes: no stream waits for that.
            cast(Camera, view.frames).close()

    def frames(self, clock: Clock) -> Iterator[Taken]:
        """The frames, as soon as they are there."""
        arrived, start, most = Condition(), clock.now(), math.ceil(LONGEST * self.rig.fps)
        readers = [CameraReader(cast(Camera, view.frames), clock, arrived, start, most) for view in self._views]
        used: list[Image | None] = [None] * len(readers)
        black: list[bool] = [False] * len(readers)
        number = -1
        try:
            with ThreadPoolExecutor(min(len(readers), usable_cores())) as pool:
                while self._end is None or number + 1 < self._end:
                    images = self._next_images(readers, used, clock, arrived)
                    if images is None:
                        return
                    new = [
                        (image, 0 if last is None else image.number - last.number)
                        for image, last in zip(images, used, strict=True)
                        if image is not None and image is not last
                    ]
                    # A frame is lost if all cameras have moved on by more than one image, not if one had a hiccup.
                    number += max(1, min(step for _, step in new))
                    self._tell_changes(black, images, readers)
                    black = [image is None for image in images]
                    used = [last if image is None else image for image, last in zip(images, used, strict=True)]
                    yield Taken(number, min(image.time for image, _ in new), self._silhouettes(pool, images))
        finally:
            for reader in readers:
                reader.close(_TO_END)

    def _next_images(
        self, readers: Sequence[CameraReader], used: Sequence[Image | None], clock: Clock, arrived: Condition
    ) -> list[Image | None] | None:
        """Wait until all cameras have a new image, but not long for a late one. None at the end.

        A camera without images for long, or that has ended, has None; a late one has its image of before.
        """
        with arrived:
            while not clock.stopped():
                now = clock.now()
                there = [reader for reader in readers if reader.waiting]
                awaited = [
                    (reader, last)
                    for reader, last in zip(readers, used, strict=True)
                    if not (reader.waiting or reader.ended or now - reader.last_time > _SILENT)
                ]
                if there:
                    first = min(reader.waiting[0].time for reader in there)
                    is_late = now - first > _LATE / self.rig.fps and all(last is not None for _, last in awaited)
                    if not awaited or is_late:
                        held = [reader for reader, _ in awaited]
                        time = max(reader.waiting[0].time for reader in there)
                        dropped = to_drop(now - time, 1 / self.rig.fps)
                        return [
                            last if reader in held else _taken_at(time, dropped, reader)
                            for reader, last in zip(readers, used, strict=True)
                        ]
                elif all(reader.ended for reader in readers):
                    return None
                arrived.wait(_LOOK_UP)
        return None

    def _tell_changes(
        self, black: Sequence[bool], images: Sequence[Image | None], readers: Sequence[CameraReader]
    ) -> None:
        for view, was_black, image, reader in zip(self._views, black, images, readers, strict=True):
            if image is None and not was_black:
                told = "gives no more images" if reader.ended else f"has given no image for {_SILENT:g} s"
                self._tell(f"view {view.name}: the camera {told}; the view is black")
            elif image is not None and was_black:
                self._tell(f"view {view.name}: the camera gives images again")

    def _silhouettes(self, pool: ThreadPoolExecutor, images: Sequence[Image | None]) -> UInt8[np.ndarray, "cams h w8"]:
        silhouettes = np.zeros(self.rig.silhouettes.shape[1:], np.uint8)

        def fill(row: int) -> None:
            image = images[row]
            if image is not None:
                bits = self._bits(self._views[row], image.pixels)
                silhouettes[row, : bits.shape[0], : bits.shape[1]] = bits

        list(pool.map(fill, range(len(images))))  # raises what one of them raises
        return silhouettes

    @staticmethod
    def _bits(view: View, pixels: np.ndarray) -> UInt8[np.ndarray, "h w8"]:
        try:
            return np.packbits(view.matte.foreground(pixels), axis=-1)
        except ValueError as error:
            raise fault(view.frames.path, None, f"view {view.name}: {error}") from None


def _taken_at(time: float, dropped: int, reader: CameraReader) -> Image | None:
    """Take the image of a camera that is nearest to a time (s), but for those to be dropped; None if none waits."""
    waiting = reader.waiting
    while len(waiting) > 1 and abs(waiting[1].time - time) <= abs(waiting[0].time - time):
        waiting.popleft()
    for _ in range(min(dropped, len(waiting) - 1)):
        waiting.popleft()
    return waiting.popleft() if waiting else None
