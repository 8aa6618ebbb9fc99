"""The cores that a process runs on."""

import os
from contextlib import suppress
from pathlib import Path


def take_core(number: int) -> None:
    """Keep this process to one of the cores it may use, where the system can; before JAX starts its threads."""
    if not hasattr(os, "sched_setaffinity"):
        return
    mine = sorted(os.sched_getaffinity(0))
    keep_to({mine[number % len(mine)]})


def keep_to(cores: set[int]) -> None:
    """Keep all threads of this process to some cores; what they start later follows them."""
    threads = Path("/proc/self/task")
    # NumPy has started some when it was imported.
    for thread in [int(path.name) for path in threads.iterdir()] if threads.exists() else [0]:
        with suppress(ProcessLookupError):
            os.sched_setaffinity(thread, cores)
