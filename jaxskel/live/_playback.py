"""A recording that is played at its rate, as if its cameras were running."""

import math
from collections.abc import Iterator
from dataclasses import replace

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
        start, number = clock.now(), 0
        while number < self._end:
            late = clock.now() - start - number / self.rig.fps
            # The last frame comes, however late, so that the dropped ones before it can be counted.
            number = int(min(number + to_drop(late, 1 / self.rig.fps), self._end - 1))
            clock.sleep(start + number / self.rig.fps - clock.now())
            if clock.stopped():
                return
            yield Taken(number, start + number / self.rig.fps, self._silhouettes[number % len(self._silhouettes)])
            number += 1
