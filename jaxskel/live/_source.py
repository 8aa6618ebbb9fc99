"""Where the frames of a live session come from."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import UInt8

from ..recording import Recording
from ._clock import Clock

PATIENCE = 0.2
"""How late a frame may be taken before others are dropped (s): as long as a search for the person takes, which is
longer than frames are apart, while following is faster."""
LONGEST = 0.5
"""How late a frame may be at most (s)."""


def to_drop(late: float, interval: float) -> int:
    """Number of frames to drop for the next one, which would be late.

    Every other frame is dropped until the rest is in time again: who is followed with larger gaps is lost, and has to
    be searched for, which makes everything later still. Beyond `LONGEST` that would not help.

    Args:
        late: Time since the next frame was taken (s).
        interval: Time between two frames (s).
    """
    if late > LONGEST:
        return math.ceil((late - PATIENCE) / interval)
    return int(late > PATIENCE)


@dataclass(frozen=True)
class Taken:
    """One frame: the silhouettes of all views.

    Attributes:
        number: Counts the frames of the source from 0; the numbers of frames that were dropped are missing.
        time: When it was taken, by the clock of the session (s).
        silhouettes: Packed bits, as from `numpy.packbits` over the width.
    """

    number: int
    time: float
    silhouettes: UInt8[np.ndarray, "cams h w8"]


@runtime_checkable
class Source(Protocol):
    """Frames that come whether somebody is ready for them or not."""

    @property
    def rig(self) -> Recording:
        """Cameras, up axis, frame rate and subject: a recording without frames."""
        ...

    def frames(self, clock: Clock) -> Iterator[Taken]:
        """Wait for each frame in turn, and leave out those that whoever asks is too late for.

        It ends where the source does, or where the clock is stopped.
        """
        ...
