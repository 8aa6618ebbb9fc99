"""Reconstructs a recording in several processes, each on its own core; the poses come in order."""

import pickle
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import UInt8

from .._runtime.cores import take_core
from ..poses import Poses
from ..recording import Recording
from ..search import Track
from ._prepare import prepare
from ._prepared import Prepared
from ._reconstruct import BATCH, reconstruct_batch
from ._settings import Settings


def reconstruct_parallel(
    recording: Recording, jobs: int, settings: Settings | None = None, prepared: Prepared | None = None
) -> Iterator[Poses]:
    """Reconstruct a recording batch by batch, in order, in several processes: see `reconstruct_batches`.

    Without tracking, the poses are the same as from one process. With tracking, each process tracks the person
    through its own stretch of frames.

    Processes are spawned: a script that calls this needs ``if __name__ == "__main__":``.

    Args:
        recording: Silhouettes and cameras.
        jobs: Number of processes.
        settings: How to reconstruct.
        prepared: Result of `prepare` for this recording and these settings.

    Raises:
        ValueError: `jobs` is less than one.
        MemoryError: A process was killed.
    """
    if jobs < 1:
        raise ValueError(f"{jobs} jobs: give at least one")
    settings = settings or Settings()
    prepared = prepared or prepare(recording, settings)
    context = get_context("spawn")
    cores = context.SimpleQueue()
    for number in range(jobs):
        cores.put(number)
    given = pickle.dumps((recording[:0], prepared, settings))
    try:
        with ProcessPoolExecutor(jobs, context, _begin, (cores, given)) as pool:
            yield from _in_order(pool, recording, _stretches(len(recording), jobs, settings), 2 * jobs)
    except BrokenProcessPool:
        raise MemoryError(
            f"one of {jobs} processes was killed, probably out of memory: each takes 1 to 2 GB; give fewer jobs"
        ) from None


def _stretches(frames: int, jobs: int, settings: Settings) -> list[list[int]]:
    """First frames of the batches, grouped into stretches that must be done one after the other."""
    starts = list(range(0, frames, BATCH))
    if settings.tracking is None:
        return [[start] for start in starts]
    size = max(1, -(-len(starts) // jobs))
    return [starts[first : first + size] for first in range(0, len(starts), size)]


def _in_order(pool: Executor, recording: Recording, stretches: list[list[int]], at_once: int) -> Iterator[Poses]:
    """Work on some stretches at once, and yield the poses in order."""

    def submit(stretch: list[int], track: Track | None) -> Future:
        return pool.submit(_batch, recording.silhouettes[stretch[0] : stretch[0] + BATCH], track)

    waiting = iter(stretches)
    running: dict[Future, list[int]] = {}
    done: dict[int, Poses] = {}
    coming = 0
    while coming < len(recording):
        # A limited number at once, otherwise silhouettes and poses would fill the memory.
        while len(running) < at_once and (stretch := next(waiting, None)) is not None:
            running[submit(stretch, None)] = stretch
        finished, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in finished:
            stretch = running.pop(future)
            poses, track = future.result()
            index = recording.frame_index[stretch[0] : stretch[0] + len(poses)]
            done[stretch[0]] = eqx.tree_at(lambda p: p.frame_index, poses, index)
            if len(stretch) > 1:
                running[submit(stretch[1:], track)] = stretch[1:]
        while coming in done:
            poses = done.pop(coming)
            coming += len(poses)
            yield poses


_given: tuple[Recording, Prepared, Settings]
"""Data of a process, set once when it starts."""


def _begin(cores: Any, given: bytes) -> None:
    """Take a core before JAX counts them, then unpack."""
    global _given
    take_core(cores.get())
    _given = pickle.loads(given)


def _batch(silhouettes: UInt8[np.ndarray, "frames cams h w8"], track: Track | None) -> tuple[Poses, Track | None]:
    recording, prepared, settings = _given
    return reconstruct_batch(silhouettes, recording, prepared, settings, track=track)
