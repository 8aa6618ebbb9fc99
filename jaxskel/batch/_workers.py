"""Processes that work on recordings, each on its own core. If one dies, only its recording fails."""

import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import wait
from pathlib import Path

from .._runtime.plain_text import plain
from .._runtime.worker_processes import WorkerProcess
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
    given = pickle.dumps(_WorkOnOne(output, method, request))
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
                    event, problem = worker.listen(), _killed
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


class _Worker(WorkerProcess):
    """A process and the recording that it works on.

    Attributes:
        heard: When it last gave a sign of life.
        doing: Its last reported activity.
    """

    source: Source | None = None
    heard: float = 0.0
    doing: str = "starting"

    def begin(self, source: Source | None) -> None:
        """Give the process a recording, or None if there is none left."""
        self.source = source
        self.heard, self.doing = time.monotonic(), "starting"
        if source is not None:
            self.give(source)

    def listen(self) -> "Progress | Finished | _Sign | None":
        """The next message of the process; None if it is dead."""
        try:
            event = self.receive()
        except EOFError:
            return None
        self.heard = time.monotonic()
        if isinstance(event, _Sign):
            self.doing = event.doing
        return event


@dataclass(frozen=True)
class _WorkOnOne:
    """What each process does with a recording."""

    output: Path
    method: Method
    request: str

    def __call__(self, source: Source, send: Callable[["Progress | Finished | _Sign"], None]) -> None:
        """Reconstruct the recording and send progress, signs of life, and the result."""
        said, at = "", 0.0

        def on_frames(done: int, total: int) -> None:
            send(Progress(source, done, total))

        def on_sign(doing: str) -> None:
            nonlocal said, at
            now = time.monotonic()
            if doing != said or now > at + _BETWEEN_SIGNS:
                said, at = doing, now
                send(_Sign(doing))

        send(Finished(source, reconstruct_one(source, self.output, self.method, self.request, on_frames, on_sign)))
