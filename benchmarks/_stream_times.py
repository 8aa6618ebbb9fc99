"""Time of each frame of a stream, beside NumPy's carving of the same frames."""

import time
from typing import NamedTuple

import numpy as np
from _peers_hull import numpy_gather

from jaxskel import Prepared, Recording, Settings, Stream, unpack_silhouettes


class StreamTimes(NamedTuple):
    """Seconds for each frame but the first, which finds the person."""

    frames: np.ndarray
    """By `Stream.push`."""
    carving: float
    """Median of a frame by NumPy's look-ups in index tables, between the frames of the stream."""


def stream_times(recording: Recording, settings: Settings, prepared: Prepared, repeat: int) -> StreamTimes:
    """Push a film through streams that know the subject, after one that compiles."""
    assert prepared.table is not None
    subject = prepared.skeleton if settings.search is None else prepared.body
    masks = unpack_silhouettes(recording.silhouettes[:1], prepared.table.size[1])
    carve = numpy_gather(masks, prepared.table)
    frames, carvings = [], []
    for turn in range(1 + repeat):
        with Stream(recording.cameras, settings, subject, recording.up, recording.fps) as stream:
            for number, frame in enumerate(np.asarray(recording.silhouettes)):
                start = time.perf_counter()
                carve()
                between = time.perf_counter()
                stream.push(frame)
                if turn and number:
                    carvings.append(between - start)
                    frames.append(time.perf_counter() - between)
    return StreamTimes(np.array(frames), float(np.median(carvings)))
