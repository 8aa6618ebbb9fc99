"""Speed by stage on one sequence file, after start-up.

    taskset -c 0 python benchmarks/speed.py SEQUENCE.npz [--repeat 5]

Prints the Markdown table of the README: milliseconds a frame and frames per second, medians over the repetitions.
Pin the process to one core, as above, to measure what one core does.
"""

import argparse
import os
import time
from pathlib import Path

import numpy as np

from jaxskel import Settings, paper_settings, prepare, read_recording, reconstruct_batches
from jaxskel.cli._progress import StageTimes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", type=Path)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--preset", choices=("default", "paper"), default="default", help="as in `jaxskel run`")
    arguments = parser.parse_args()
    recording = read_recording(arguments.sequence)
    settings = paper_settings() if arguments.preset == "paper" else Settings()
    start = time.perf_counter()
    prepared = prepare(recording, settings)
    print(f"prepared in {time.perf_counter() - start:.1f} s: {prepared.table.grid.shape if prepared.table else None}")
    for _ in reconstruct_batches(recording, settings, prepared):  # compiles
        pass
    runs = []
    for _ in range(arguments.repeat):
        times = StageTimes()
        start = time.perf_counter()
        for _ in reconstruct_batches(recording, settings, prepared, times):
            pass
        runs.append(dict(times.later) | {"all": time.perf_counter() - start})
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    print(f"{recording.name}: {len(recording)} frames, {len(recording.cameras)} cameras, {cores} core(s)\n")
    print("| stage | ms a frame | frames per second |\n|---|---|---|")
    for stage in runs[0]:
        per_frame = float(np.median([run[stage] for run in runs])) / len(recording)
        print(f"| {stage} | {1e3 * per_frame:.1f} | {1 / per_frame:.0f} |")


if __name__ == "__main__":
    main()
