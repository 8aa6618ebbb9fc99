"""The loop of a live session: a frame, its pose, and everybody who wants it."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import UInt8

from ..poses import Poses
from ._clock import Clock
from ._source import Source
from ._tally import Moment, Tally

Sink = Callable[[Poses, Moment], None]
"""Takes the poses of one frame, numbered as the frame is, and must not keep the loop waiting."""


@runtime_checkable
class Reconstruct(Protocol):
    """Makes poses of one frame, such as [`Stream.push`][jaxskel.Stream]."""

    def __call__(self, masks: UInt8[np.ndarray, "cams h w8"], skipped: int, hurry: bool) -> Poses:
        """Poses of one frame; how many were left out before it, and whether others wait."""
        ...


def play(
    source: Source,
    reconstruct: Reconstruct,
    sinks: Iterable[Sink],
    clock: Clock,
    tally: Tally,
) -> None:
    """Reconstruct the frames of a source as they come and hand each to all sinks, until the source or the clock ends.

    Args:
        source: Where the frames come from.
        reconstruct: Makes poses of one frame.
        sinks: Who gets the poses, in this order.
        clock: The session's clock.
        tally: Counts.
    """
    sinks, following = tuple(sinks), 0
    for taken in source.frames(clock):
        # Another frame has been taken since.
        hurry = (clock.now() - taken.time) * source.rig.fps > 1
        poses = reconstruct(taken.silhouettes, taken.number - following, hurry)
        following = taken.number + 1
        poses = replace(poses, frame_index=np.array([taken.number]))
        moment = tally.begin(taken.number)
        for sink in sinks:
            sink(poses, moment)
        tally.end(taken.time, clock.now())
