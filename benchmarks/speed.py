"""Speed by stage on one sequence file, after start-up.

    taskset -c 0 python benchmarks/speed.py SEQUENCE.npz [--repeat 5] [--preset tracked] [--stream]

Prints the table of notebooks/speed.md: milliseconds per frame and frames per second, medians over the repetitions, also
as multiples of NumPy's carving in the same run.
With --stream, prints how long single frames of a film wait for their pose, also as multiples of NumPy's carving.
Pin the process to one core, as above, to measure a single core.
"""

import argparse
import os
import time
from pathlib import Path

import numpy as np
from _presets import PRESETS
from _stage_times import NUMPY, stage_times
from _stream_times import stream_times

from jaxskel import prepare, read_recording


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", type=Path)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--preset", choices=list(PRESETS), default="default", help="how to reconstruct")
    parser.add_argument("--stream", action="store_true", help="time single frames of a stream")
    arguments = parser.parse_args()
    recording = read_recording(arguments.sequence)
    settings = PRESETS[arguments.preset].settings()
    start = time.perf_counter()
    prepared = prepare(recording, settings)
    print(f"prepared in {time.perf_counter() - start:.1f} s: {prepared.table.grid.shape if prepared.table else None}")
    if arguments.stream:
        frames, carving = stream_times(recording, settings, prepared, arguments.repeat)
        print(f"{recording.name}: NumPy carves a frame in {1e3 * carving:.1f} ms\n")
        print("| a stream's frames | ms | of NumPy's carving |\n|---|---|---|")
        for name, share in (("median", 50), ("99th percentile", 99)):
            each = float(np.percentile(frames, share))
            print(f"| {name} | {1e3 * each:.1f} | {each / carving:.1f} |")
        return
    times = stage_times(recording, settings, prepared, arguments.repeat)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    print(f"{recording.name}: {len(recording)} frames, {len(recording.cameras)} cameras, {cores} core(s)\n")
    print("| stage | ms a frame | frames per second | of NumPy's carving |\n|---|---|---|---|")
    for stage, milliseconds in times.items():
        print(f"| {stage} | {milliseconds:.1f} | {1e3 / milliseconds:.0f} | {milliseconds / times[NUMPY]:.2f} |")


if __name__ == "__main__":
    main()
