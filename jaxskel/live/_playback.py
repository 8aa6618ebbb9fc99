"""A recording that is played at its rate, as if its cameras were running."""

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from jaxtyping import UInt8

from ..recording import Recording
from ._clock import Clock
from ._source import Taken, to_drop


class Playback:
    """Plays a recording by the clock. A [`Source`][].

    Args:
        recording: What is played.
        fps: Frames per second, if not those of the recording.
        loop: Whether it begins again after its end, for ever.
        seconds: Ends after this time, if given.
    """

    def __init__(
        self, recording: Recording, fps: float | None = None, loop: bool = False, seconds: float | None = None
    ):
        self._silhouettes = recording.silhouettes
        self.rig = replace(recording[:0], truth=None, fps=recording.fps if fps is None else fps)
        ends = [math.inf if loop else len(recording)]
        if seconds is not None:
            ends.append(max(1, round(seconds * self.rig.fps)))
        self._end = min(ends)

    def frames(self, clock: Clock) -> Iterator[Taken]:
        """The frames, each at its time or a little later."""
        start, number, read_ahead = clock.now(), 0, 0
        # A large recording stays in its file: the next frame is read while this one is worked on.
        with ThreadPoolExecutor(1) as reader:
            silhouettes = reader.submit(self._read, 0)
            while number < self._end:
                late = clock.now() - start - number / self.rig.fps
                # The last frame comes, however late, so that the dropped ones before it can be counted.
                number = int(min(number + to_drop(late, 1 / self.rig.fps), self._end - 1))
                if number != read_ahead:
                    silhouettes = reader.submit(self._read, number)
                clock.sleep(start + number / self.rig.fps - clock.now())
                if clock.stopped():
                    return
                taken = Taken(number, start + number / self.rig.fps, silhouettes.result())
                number = read_ahead = number + 1
                silhouettes = reader.submit(self._read, number)
                yield taken

    def _read(self, number: int) -> UInt8[np.ndarray, "cams h w8"]:
        return self._silhouettes[number % len(self._silhouettes)]
