import gc
import os
import signal

import jax
import pytest

from jaxskel._runtime.compile_cache import CachedJit

# The suite compiles for half of its time. Without LLVM's expensive passes it compiles a quarter faster (measured on
# tests/refinement/test_sequence.py: 108 s, then 83 s), and what it computes is small.
os.environ.setdefault("XLA_FLAGS", "--xla_llvm_disable_expensive_passes=true")

# A shell that starts a job in the background lets it ignore interrupts, and all that the job starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True, scope="session")
def no_silent_broadcasting():
    """The classic bug of geometry: a vector meets a stack of vectors, and every shape still fits."""
    jax.config.update("jax_numpy_rank_promotion", "raise")


@pytest.fixture(autouse=True, scope="module")
def no_more_programs_than_a_process_may_hold():
    """A compiled function maps pages of its own; a suite that keeps thousands meets the kernel's limit and aborts."""
    yield
    jax.clear_caches()
    for kept in (thing for thing in gc.get_objects() if isinstance(thing, CachedJit)):
        kept.forget()
