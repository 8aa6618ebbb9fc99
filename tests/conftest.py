import gc
import os
import signal
from pathlib import Path

# At LLVM's first level of optimisation, tracing and compiling take a sixth less time than at the second, and programs
# run as fast. JAX reads this when it makes its backend; processes that tests start inherit it.
os.environ.setdefault("XLA_FLAGS", "--xla_backend_optimization_level=1")

import jax
import pytest

from jaxskel._runtime.compile_cache import CachedJit

# A shell that starts a job in the background lets it ignore interrupts, and all that the job starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True, scope="session")
def no_silent_broadcasting():
    """The classic bug of geometry: a vector meets a stack of vectors, and every shape still fits."""
    jax.config.update("jax_numpy_rank_promotion", "raise")


# Rooms and files whose programs are compiled for longer than they run.
HARDLY_RUN = {"refinement", "body_calibration", "test_table.py", "test_soft_carve.py"}


@pytest.fixture(autouse=True, scope="module")
def compiled_only_to_run_once(request: pytest.FixtureRequest):
    """Without LLVM's optimisations a solve is compiled in half of the time, but runs six times as long."""
    hardly = bool(HARDLY_RUN & set(request.path.parts))
    jax.config.update("jax_disable_most_optimizations", hardly)
    yield
    jax.config.update("jax_disable_most_optimizations", False)


# Linux allows a process 65530 mappings. The difference is reserved for the tests of one more file.
MOST_MAPPINGS = 25_000


def mappings() -> int:
    """Number of mappings of this process; the largest allowed number if the system does not report it."""
    try:
        return Path("/proc/self/maps").read_bytes().count(b"\n")
    except OSError:
        return MOST_MAPPINGS


@pytest.fixture(autouse=True, scope="module")
def no_more_programs_than_a_process_may_hold():
    """Every compiled function maps memory pages; with thousands of them, the suite would reach the kernel's limit.

    Below the limit they are kept, so that files can share compiled functions.
    """
    yield
    if mappings() < MOST_MAPPINGS:
        return
    jax.clear_caches()
    for kept in (thing for thing in gc.get_objects() if isinstance(thing, CachedJit)):
        kept.forget()
