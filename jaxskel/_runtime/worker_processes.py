"""Spawned processes, each on its own core, that work on one task at a time and end with the process that made them."""

import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection
from typing import Any

from .cores import one_solver_thread, take_core

# Longest wait for a killed process to end (s). One that does not end hangs on a disk that is gone.
_TO_END = 10.0


def pickled(work: Any, what: str, remedy: str) -> bytes:
    """Work as it is sent to a process.

    Args:
        work: A function of a task and of a function that sends a message.
        what: The argument that may hold what cannot be sent, for the message.
        remedy: What else to do, for the message.

    Raises:
        ValueError: One line; it holds a function that only this process knows.
    """
    try:
        return pickle.dumps(work)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ValueError(
            f"{what}: cannot be sent to another process ({error}); define its functions at the top of a file that can "
            f"be imported, not as a lambda, or {remedy}"
        ) from None


class WorkerProcess:
    """One process. It unpickles `work` once and calls it with each task and a function that sends messages back.

    Processes are spawned: a script that makes one needs ``if __name__ == "__main__":``. They ignore the signals of
    terminals and schedulers: the process that made them decides when they end. If that process dies, they end too.

    Args:
        core: Number of the core that it takes.
        work: A pickled function of a task and of a function that sends a message.
    """

    def __init__(self, core: int, work: bytes):
        context = get_context("spawn")
        self.core = core
        self.pipe, theirs = context.Pipe()
        # Only this process holds the other end, so the pipe closes when this process ends, even if it is killed.
        alive, self._alive = context.Pipe(duplex=False)
        self.process = context.Process(target=_work, args=(core, work, theirs, alive))
        with signals_ignored():
            self.process.start()
        theirs.close()
        alive.close()

    def give(self, task: Any) -> None:
        """Give the process a task. If it is dead, `receive` will say so."""
        try:
            self.pipe.send(task)
        except OSError:
            pass

    def receive(self) -> Any:
        """Wait for the next message of the process.

        Raises:
            EOFError: The process is dead.
        """
        try:
            return self.pipe.recv()
        except OSError:
            raise EOFError from None

    def end(self) -> int | None:
        """End the process and return its exit code."""
        self.process.kill()
        self.process.join(_TO_END)
        self.pipe.close()
        self._alive.close()
        return self.process.exitcode


@contextmanager
def signals_ignored() -> Iterator[None]:
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


def _work(core: int, work: bytes, pipe: Connection, alive: Connection) -> None:
    threading.Thread(target=_end_with, args=(alive,), daemon=True).start()
    one_solver_thread()
    take_core(core)  # before JAX, which the next line imports, counts the cores
    call: Callable[[Any, Callable[[Any], None]], None] = pickle.loads(work)
    while True:
        call(pipe.recv(), pipe.send)


def _end_with(alive: Any) -> None:
    """End this process as soon as the one that made it has ended."""
    try:
        alive.recv_bytes()
    except (EOFError, OSError):
        pass
    os._exit(1)
