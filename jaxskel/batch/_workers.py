"""Processes that work on recordings, each on its own core. If one dies, only its recording fails."""

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
"""Longest time (s) without a sign of life. Compiling takes up to 2 minutes on a slow and busy machine; computing the
background of long films in the largest format takes tens of minutes."""
# A process repeats the same sign only after this time (s).
_BETWEEN_SIGNS = 0.5
# Longest wait for a killed process to end (s). One that does not end hangs on a disk that is gone.
_TO_END = 10.0
# Longest single wait (s). If a wait lasts _LOST (s) longer than asked for, or that time passes between waits, this
# process was stopped or the machine slept. The workers' silence does not count then.
_WAIT, _LOST = 60.0, 5.0


@dataclass(frozen=True)
class Progress:
    """Number of finished frames of a recording, and of all its frames."""

    source: Source
    done: int
    total: int


@dataclass(frozen=True)
class Finished:
    """A recording that has a result, or has failed."""

    source: Source
    manifest: Manifest

    def told(self, number: int, total: int) -> str:
        """A line of progress: this is recording `number` of `total`."""
        return plain(f"[{number}/{total}] {self.source.name}: {self.manifest.told}")


@dataclass(frozen=True)
class _Sign:
    """A sign of life: the current activity of a process."""

    doing: str


def work_on(
    sources: Sequence[Source], output: Path, method: Method, jobs: int, request: str = "", timeout: float = TIMEOUT
) -> Iterator[Progress | Finished]:
    """Work on recordings in several processes, and yield progress events.

    Processes are spawned: a script that calls this needs ``if __name__ == "__main__":``. They end with this process,
    even if it is killed.

    A process that gives no sign of life for `timeout` seconds is killed, and its recording fails. A sign is sent when
    a part of the work begins, when a few megabytes of files or up to 32 frames were read, and when 32 frames are done.
    Processes that hang or are stopped send none.
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
        f"{source.path}: its process was killed ({how}), perhaps out of memory: each takes 1 to 2 GB; give fewer jobs "
        "and run again"
    )


def _silent(timeout: float, doing: str, source: Source, code: int | None) -> str:
    return (
        f"{source.path}: its process gave no sign of life for {timeout:g} s ({doing}) and was killed; check its files "
        "and disk, or give a longer --timeout"
    )


class _Worker:
    """A process and the recording that it works on."""

    source: Source | None
    heard: float
    """When it last gave a sign of life."""
    doing: str
    """Its last reported activity."""

    def __init__(self, core: int, given: bytes):
        context = get_context("spawn")
        self.core, self.source = core, None
        self.heard, self.doing = time.monotonic(), "starting"
        self.pipe, theirs = context.Pipe()
        # Only this process holds the other end, so the pipe closes when this process ends, even if it is killed.
        alive, self._alive = context.Pipe(duplex=False)
        self.process = context.Process(target=_work, args=(core, given, theirs, alive))
        with _deaf():
            self.process.start()
        theirs.close()
        alive.close()

    def begin(self, source: Source | None) -> None:
        """Give the process a recording, or None if there is none left."""
        self.source = source
        self.heard, self.doing = time.monotonic(), "starting"
        if source is not None:
            try:
                self.pipe.send(source)
            except OSError:  # it is dead already; `receive` will report it
                pass

    def receive(self) -> "Progress | Finished | _Sign | None":
        """The next message of the process; None if it is dead."""
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
    """Processes started in this context ignore signals from the start.

    Terminals and schedulers send signals to all processes, but the parent process decides when its workers end.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # if it were started below, it would unblock the first two signals
    numbers = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1", "SIGUSR2")]
    before = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
    # Another thread may still receive a signal, and Python would handle it here, while a process is being started.
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
