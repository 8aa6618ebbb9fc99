"""Reconstructs a recording in several processes, each on its own core; the poses come in order."""

from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import wait
from typing import Any

import equinox as eqx

from .._runtime.worker_processes import WorkerProcess, pickled
from ..poses import Poses
from ..recording import Recording
from ..search import Track
from ._coupled_batches import check_apart
from ._film_decision import RefinedBatch, decided
from ._prepare import check_given, prepare
from ._prepared import Prepared
from ._reconstruct import BATCH, refined_batch
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
        ValueError: `jobs` is less than one, the objective couples frames, or the settings hold functions that other
            processes do not know.
        MemoryError: A process was killed.
    """
    if jobs < 1:
        raise ValueError(f"{jobs} jobs: give at least one")
    settings = settings or Settings()
    check_given(recording, settings)
    check_apart(settings, "but several processes take batches apart; leave it out, or take one, as reconstruct does")
    prepared = prepared or prepare(recording, settings)
    work = pickled(_ReconstructBatch(prepared, settings), "settings", "call reconstruct")
    stretches = _stretches(len(recording), jobs, settings)
    crew = [WorkerProcess(core, work) for core in range(min(jobs, len(stretches)))]
    try:
        for poses, _ in decided(_in_order(crew, recording, stretches)):
            yield poses
    except EOFError:
        raise MemoryError(
            f"one of {jobs} processes was killed, probably out of memory: each takes 1 to 2 GB; give fewer jobs"
        ) from None
    finally:
        for worker in crew:
            worker.end()


def _stretches(frames: int, jobs: int, settings: Settings) -> list[list[int]]:
    """First frames of the batches, grouped into stretches that must be done one after the other."""
    starts = list(range(0, frames, BATCH))
    if settings.tracking is None:
        return [[start] for start in starts]
    size = max(1, -(-len(starts) // jobs))
    return [starts[first : first + size] for first in range(0, len(starts), size)]


def _in_order(
    crew: Sequence[WorkerProcess], recording: Recording, stretches: list[list[int]]
) -> Iterator[RefinedBatch]:
    """Give each process a batch of a stretch at a time, and yield what they did in order."""

    def give(worker: WorkerProcess, track: Track | None) -> None:
        start = at_work[worker][0]
        worker.give((recording[start : start + BATCH], track))

    waiting = iter(stretches)
    at_work: dict[WorkerProcess, list[int]] = {}
    done: dict[int, RefinedBatch] = {}
    coming = 0
    for worker, stretch in zip(crew, waiting, strict=False):
        at_work[worker] = stretch
        give(worker, None)
    while coming < len(recording):
        ready = wait([worker.pipe for worker in at_work])
        for worker in [worker for worker in at_work if worker.pipe in ready]:
            message = worker.receive()
            if isinstance(message, Exception):
                raise message
            start, *rest = at_work.pop(worker)
            done[start] = message
            # Batches of a stretch follow one another; the first of the next stretch starts without a track.
            if stretch := rest or next(waiting, None):
                at_work[worker] = stretch
                give(worker, message.track if rest else None)
        while coming in done:
            batch = done.pop(coming)
            coming += len(batch.seen.status)
            yield batch


class _ReconstructBatch(eqx.Module):
    """What each process does with a batch of frames."""

    prepared: Prepared
    settings: Settings

    def __call__(self, task: tuple[Recording, Track | None], send: Callable[[Any], None]) -> None:
        """Refine a batch and send it, or the exception."""
        part, track = task
        try:
            send(refined_batch(part, self.prepared, self.settings, track=track))
        except Exception as error:
            send(error)
