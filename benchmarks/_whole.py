"""The whole pipeline from masks in memory, in separate processes: frames per second, memory, accuracy, start-up."""

import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from _presets import PRESETS
from accuracy import score_against_truth

from jaxskel import Recording, join_poses, keep_compiled, prepare, read_recording, reconstruct_batches
from jaxskel._runtime.cores import take_core
from jaxskel.pipeline._reconstruct import BATCH


class Throughput(NamedTuple):
    """Results of processes that ran at the same time."""

    frames_per_second: float
    """Frames per second of all processes together."""
    megabytes: float
    """Largest resident set of one process."""
    median_mm: float
    """Error of the joints."""


def throughput(path: Path, preset: str, processes: int, seconds: float) -> Throughput:
    """Reconstruct a sequence repeatedly for some time in spawned processes, each on its own core."""
    context = get_context("spawn")
    barrier, queue = context.Barrier(processes), context.Queue()
    workers = [
        context.Process(target=_work, args=(path, preset, number, seconds, barrier, queue))
        for number in range(processes)
    ]
    for worker in workers:
        worker.start()
    found = [queue.get() for _ in workers]
    for worker in workers:
        worker.join()
    return Throughput(sum(f[0] for f in found), max(f[1] for f in found), found[0][2])


def _work(path: Path, preset: str, number: int, seconds: float, barrier: Any, queue: Any) -> None:
    take_core(number)
    keep_compiled()
    recording = _whole_batches(read_recording(path))
    settings = PRESETS[preset].settings()
    prepared = prepare(recording, settings)
    poses = list(reconstruct_batches(recording, settings, prepared))  # compiles
    rates = []
    barrier.wait()
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        start = time.perf_counter()
        for _ in reconstruct_batches(recording, settings, prepared):
            pass
        rates.append(len(recording) / (time.perf_counter() - start))
    error = float("nan")
    if recording.truth is not None:
        error = 1e3 * score_against_truth(join_poses(poses), recording).percentile(50)
    queue.put((float(np.median(rates)), _largest_resident_set(), error))


def _largest_resident_set() -> float:
    """Largest resident set of this process (MB)."""
    status = Path("/proc/self/status")
    if status.exists():  # `getrusage` would include the process that started this one
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return float(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _whole_batches(recording: Recording) -> Recording:
    """Without the frames of an incomplete last batch, which would take as long as a full one."""
    return recording[: max(BATCH, len(recording) // BATCH * BATCH)]


# `jaxskel run`, changed to report its first batch of poses and then stop.
_FIRST_POSE = """
import os, sys
from jaxskel.cli import _progress, main
reconstruct = _progress.reconstruct_batches
def first(*args):
    next(iter(reconstruct(*args)))
    print("here", flush=True)
    os._exit(0)
_progress.reconstruct_batches = first
main()
"""


def start_up(path: Path, options: Sequence[str], repeat: int = 3) -> float:
    """Seconds from the start of `jaxskel run` to its first batch of poses, with compiled code of earlier runs."""
    times = []
    for _ in range(1 + repeat):
        start = time.perf_counter()
        with TemporaryDirectory() as folder:
            command = [sys.executable, "-c", _FIRST_POSE, "run", str(path), *options, "-o", folder]
            done = subprocess.run(command, capture_output=True, text=True)
        times.append(time.perf_counter() - start)
        if "here" not in done.stdout.split():
            raise RuntimeError(f"{path}: no pose; {done.stderr}")
    return float(np.median(times[1:]))
