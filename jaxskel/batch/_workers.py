"""Processes that work on recordings, each on a core of its own; one that dies harms its own recording only."""

import os
import pickle
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from .._parallel import take_core
from ._folders import ResultFolder
from ._manifest import Manifest, Work, current_version, failed
from ._method import Method
from ._one import reconstruct_one, recorded
from ._sources import Source

PROCESS_BYTES = 2 << 30
"""Memory that a process may take."""


@dataclass(frozen=True)
class Progress:
    """Frames of a recording that are done, and all of them."""

    source: Source
    done: int
    total: int


@dataclass(frozen=True)
class Finished:
    """A recording that has a result, or has failed."""

    source: Source
    manifest: Manifest

    def told(self, number: int, total: int) -> str:
        """A line for whoever watches, of how many that are told of."""
        return f"[{number}/{total}] {self.source.name}: {self.manifest.told}"


def work_on(
    sources: Sequence[Source], output: Path, method: Method, jobs: int, request: str = ""
) -> Iterator[Progress | Finished]:
    """Work on recordings in some processes at once, and tell how it goes.

    Processes are spawned: a script that calls this needs ``if __name__ == "__main__":``. They end with this one,
    whatever becomes of it.
    """
    waiting = iter(sources)
    given = pickle.dumps((output, method, request))
    crew = [_Worker(core, given) for core in range(min(jobs, len(sources)))]
    try:
        for worker in crew:
            worker.begin(next(waiting))
        while busy := [worker for worker in crew if worker.source is not None]:
            ready = wait([worker.pipe for worker in busy])
            for worker in busy:
                if worker.pipe not in ready:
                    continue
                event = worker.receive()
                if event is None:
                    assert worker.source is not None
                    manifest = _killed(worker.source, method, worker.end())
                    event = Finished(worker.source, recorded(ResultFolder(output, worker.source.name), manifest))
                    crew[crew.index(worker)] = worker = _Worker(worker.core, given)
                if isinstance(event, Finished):
                    worker.begin(next(waiting, None))
                yield event
    finally:
        for worker in crew:
            worker.end()


def _killed(source: Source, method: Method, code: int | None) -> Manifest:
    how = f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"
    return failed(
        Work(str(source.path), {}, method.described, current_version()),
        f"{source.path}: its process was killed ({how}), perhaps for want of memory: each takes 1 to 2 GB; give fewer "
        "jobs and run again",
    )


class _Worker:
    """A process, and what it works on."""

    source: Source | None

    def __init__(self, core: int, given: bytes):
        context = get_context("spawn")
        self.core, self.source = core, None
        self.pipe, theirs = context.Pipe()
        # Only this process holds the other end: it is closed when this one is gone, killed or not.
        alive, self._alive = context.Pipe(duplex=False)
        self.process = context.Process(target=_work, args=(core, given, theirs, alive))
        with _deaf():
            self.process.start()
        theirs.close()
        alive.close()

    def begin(self, source: Source | None) -> None:
        """Give the process a recording, or none, if there is none left."""
        self.source = source
        if source is not None:
            try:
                self.pipe.send(source)
            except OSError:  # it is dead already: `receive` will say so
                pass

    def receive(self) -> Progress | Finished | None:
        """What the process says next; None if it is dead."""
        try:
            return self.pipe.recv()
        except (EOFError, OSError):
            return None

    def end(self) -> int | None:
        """End the process and return its exit code."""
        self.process.kill()
        self.process.join()
        self.pipe.close()
        self._alive.close()
        return self.process.exitcode


@contextmanager
def _deaf() -> Iterator[None]:
    """What is started here takes no notice of signals, from its very beginning.

    A terminal and a scheduler send them to all processes; what becomes of these is for the first one to say.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # started later, within, it would let the first two through again
    numbers = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1", "SIGUSR2")]
    before = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
    # Another thread may take a signal all the same, and Python would handle it here, in the middle of a start.
    came: list[int] = []
    handlers = {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: signal.getsignal(number) for number in numbers if callable(signal.getsignal(number))}
    for number in handlers:
        signal.signal(number, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for number in came:
            signal.raise_signal(number)


def _work(core: int, given: bytes, pipe: Connection, alive: Connection) -> None:
    threading.Thread(target=_end_with, args=(alive,), daemon=True).start()
    take_core(core)
    output, method, request = pickle.loads(given)
    while True:
        source = pipe.recv()

        def on_frames(done: int, total: int, source: Source = source) -> None:
            pipe.send(Progress(source, done, total))

        pipe.send(Finished(source, reconstruct_one(source, output, method, request, on_frames)))


def _end_with(alive: Any) -> None:
    try:
        alive.recv_bytes()
    except (EOFError, OSError):
        pass
    os._exit(1)
