"""Time of each stage on a recording, after start-up, beside NumPy's carving of its frames."""

import time

import numpy as np
from _peers_hull import numpy_gather

from jaxskel import Prepared, Recording, Settings, reconstruct_batches, unpack_silhouettes
from jaxskel.cli._progress import StageTimes

NUMPY = "NumPy's carving"
"""Row of the yardstick: other rows are also told as multiples of it."""
# At most so many frames of the recording are carved by NumPy, once for each repetition.
_CARVED_FRAMES = 32


def stage_times(recording: Recording, settings: Settings, prepared: Prepared, repeat: int) -> dict[str, float]:
    """Milliseconds a frame by stage, of all together, and of NumPy's look-ups: medians over repetitions.

    NumPy carves before each repetition, so that both run while the machine is equally fast.
    """
    assert prepared.table is not None
    carved = unpack_silhouettes(recording.silhouettes[:_CARVED_FRAMES], prepared.table.size[1])
    carve = numpy_gather(carved, prepared.table)
    runs = []
    for turn in range(1 + repeat):
        start = time.perf_counter()
        carve()
        carving = (time.perf_counter() - start) * len(recording) / len(carved)
        watch, start = StageTimes(), time.perf_counter()
        for _ in reconstruct_batches(recording, settings, prepared, watch):
            pass
        if turn:  # the first one compiles
            runs.append({**watch.later, "all": time.perf_counter() - start, NUMPY: carving})
    return {stage: 1e3 * float(np.median([run[stage] for run in runs])) / len(recording) for stage in runs[0]}
