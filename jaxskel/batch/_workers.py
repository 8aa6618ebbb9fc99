"""Processes that work on recordings, each on a core of its own; one that dies harms its own recording only."""

import os
import pickle
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from .._runtime.cores import take_core
from .._runtime.plain_text import plain
from ._folders import ResultFolder
from ._manifest import Manifest, Work, current_version, failed
from ._method import Method
from ._one import reconstruct_one, recorded
from ._sources import Source

PROCESS_BYTES = 2 << 30
"""Memory that a process may take."""
TIMEOUT = 3600.0
"""For so long (s) a process may give no sign of life. The longest that is known is to compile, 2 minutes on a slow and
busy machine; to read the background out of long films in the largest format takes tens of minutes."""
# A process tells of the same again after this time (s).
_BETWEEN_SIGNS = 0.5
# One that does not end when it is killed waits for a disk that is gone; nobody waits for it longer than this (s).
_TO_END = 10.0
# Waited for at once (s). Where it takes so much longer, or what is between takes so long, this process was stopped
# itself, or the machine slept: nobody's silence counts then.
_WAIT, _LOST = 60.0, 5.0


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
        return plain(f"[{number}/{total}] {self.source.name}: {self.manifest.told}")


@dataclass(frozen=True)
class _Sign:
    """A sign of life: what a process does now."""

    doing: str


def work_on(
    sources: Sequence[Source], output: Path, method: Method, jobs: int, request: str = "", timeout: float = TIMEOUT
) -> Iterator[Progress | Finished]:
    """Work on recordings in some processes at once, and tell how it goes.

    Processes are spawned: a script that calls this needs ``if __name__ == "__main__":``. They end with this one,
    whatever becomes of it.

    A process that gives no sign of life for `timeout` seconds is killed, which costs its recording. Signs are that
    a part of the work begins, that a few megabytes of files or up to 32 frames are read, and that 32 frames are done:
    what hangs gives none, and neither does what is stopped.
    """
    waiting = iter(sources)
    given = pickle.dumps((output, method, request))
    crew = [_Worker(core, given) for core in range(min(jobs, len(sources)))]
    try:
        for worker in crew:
            worker.begin(next(waiting))
        awake = time.monotonic()
        while busy := [worker for worker in crew if worker.source is not None]:
            begin = time.monotonic()
            patience = min(max(0.0, min(worker.heard + timeout for worker in busy) - begin), _WAIT)
            ready = wait([worker.pipe for worker in busy], patience)
            if max(begin - awake, time.monotonic() - begin - patience) > _LOST:
                for worker in busy:
                    worker.heard = time.monotonic()
            awake = time.monotonic()
            for worker in busy:
                assert worker.source is not None
                if worker.pipe in ready:
                    event, problem = worker.receive(), _killed
                elif awake - worker.heard >= timeout:
                    event, problem = None, partial(_silent, timeout, worker.doing)
                else:
                    continue
                if event is None:
                    work = Work(str(worker.source.path), {}, method.described, current_version())
                    manifest = failed(work, problem(worker.source, worker.end()))
                    event = Finished(worker.source, recorded(ResultFolder(output, worker.source.name), manifest))
                    crew[crew.index(worker)] = worker = _Worker(worker.core, given)
                if isinstance(event, Finished):
                    worker.begin(next(waiting, None))
                if not isinstance(event, _Sign):
                    yield event
    finally:
        for worker in crew:
            worker.end()


def _killed(source: Source, code: int | None) -> str:
    how = f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"
    return (
        f"{source.path}: its process was killed ({how}), perhaps for want of memory: each takes 1 to 2 GB; give fewer "
        "jobs and run again"
    )


def _silent(timeout: float, doing: str, source: Source, code: int | None) -> str:
    return (
        f"{source.path}: its process gave no sign of life for {timeout:g} s ({doing}) and was killed; check its files "
        "and disk, or give a longer --timeout"
    )


class _Worker:
    """A process, and what it works on."""

    source: Source | None
    heard: float
    """When it last gave a sign of life."""
    doing: str
    """What it said then."""

    def __init__(self, core: int, given: bytes):
        context = get_context("spawn")
        self.core, self.source = core, None
        self.heard, self.doing = time.monotonic(), "starting"
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
        self.heard, self.doing = time.monotonic(), "starting"
        if source is not None:
            try:
                self.pipe.send(source)
            except OSError:  # it is dead already: `receive` will say so
                pass

    def receive(self) -> "Progress | Finished | _Sign | None":
        """What the process says next; None if it is dead."""
        try:
            event = self.pipe.recv()
        except (EOFError, OSError):
            return None
        self.heard = time.monotonic()
        if isinstance(event, _Sign):
            self.doing = event.doing
        return event

    def end(self) -> int | None:
        """End the process and return its exit code."""
        self.process.kill()
        self.process.join(_TO_END)
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
        said = {"doing": "", "at": 0.0}

        def on_frames(done: int, total: int, source: Source = source) -> None:
            pipe.send(Progress(source, done, total))

        def on_sign(doing: str, said: dict[str, Any] = said) -> None:
            now = time.monotonic()
            if doing != said["doing"] or now > said["at"] + _BETWEEN_SIGNS:
                said |= {"doing": doing, "at": now}
                pipe.send(_Sign(doing))

        pipe.send(Finished(source, reconstruct_one(source, output, method, request, on_frames, on_sign)))


def _end_with(alive: Any) -> None:
    try:
        alive.recv_bytes()
    except (EOFError, OSError):
        pass
    os._exit(1)
