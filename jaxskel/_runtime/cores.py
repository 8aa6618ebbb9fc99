"""Assignment of a process to processor cores."""

import os
from contextlib import suppress
from pathlib import Path

from threadpoolctl import threadpool_limits


def usable_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def one_solver_thread() -> None:
    """Let NumPy and SciPy solve linear systems in one thread each; for processes of our own only.

    Systems here have tens of unknowns, and OpenBLAS's threads wait busily for the next one, against all other work: a
    warm start of `run` took 15.4 s of CPU so on two cores, and takes 12.1 s in one thread.
    """
    # For libraries that are loaded later, and for processes that this one starts.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    threadpool_limits(1, user_api="blas")


def take_core(number: int) -> None:
    """Pin this process to one of the cores it may use, if the system can; call it before JAX starts its threads."""
    if not hasattr(os, "sched_setaffinity"):
        return
    mine = sorted(os.sched_getaffinity(0))
    keep_to({mine[number % len(mine)]})


def keep_to(cores: set[int]) -> None:
    """Pin all threads of this process to some cores; threads started later inherit this."""
    threads = Path("/proc/self/task")
    # NumPy starts some threads when it is imported.
    for thread in [int(path.name) for path in threads.iterdir()] if threads.exists() else [0]:
        with suppress(ProcessLookupError):
            os.sched_setaffinity(thread, cores)
