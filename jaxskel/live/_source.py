"""Where the frames of a live session come from."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import UInt8

from ..recording import Recording
from ._clock import Clock

PATIENCE = 0.25
"""How long a frame waits for whoever is late for it (s); then it is dropped. Following a person is faster than frames
come, but searching takes as long as some frames: they must be caught up with, because who is followed with gaps is
lost, and searched for again."""


@dataclass(frozen=True)
class Taken:
    """One frame: the silhouettes of all views."""

    number: int
    """Counts the frames of the source from 0; the numbers of frames that were dropped are missing."""
    time: float
    """When it was taken, by the clock of the session (s)."""
    silhouettes: UInt8[np.ndarray, "cams h w8"]
    """Packed bits, as from `numpy.packbits` over the width."""


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
