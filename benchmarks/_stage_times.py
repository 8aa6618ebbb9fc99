"""Time of each stage on a recording, after start-up."""

import time

import numpy as np

from jaxskel import Prepared, Recording, Settings, reconstruct_batches
from jaxskel.cli._progress import StageTimes


def stage_times(recording: Recording, settings: Settings, prepared: Prepared, repeat: int) -> dict[str, float]:
    """Milliseconds a frame by stage, then of all together: medians over repetitions."""
    runs = []
    for turn in range(1 + repeat):
        watch, start = StageTimes(), time.perf_counter()
        for _ in reconstruct_batches(recording, settings, prepared, watch):
            pass
        if turn:  # the first one compiles
            runs.append({**watch.later, "all": time.perf_counter() - start})
    return {stage: 1e3 * float(np.median([run[stage] for run in runs])) / len(recording) for stage in runs[0]}
