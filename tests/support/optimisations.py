"""How much the compiler optimises: programs that run once are compiled in half of the time without it."""

from collections.abc import Iterator
from contextlib import contextmanager

import jax


@contextmanager
def optimised(wanted: bool = True) -> Iterator[None]:
    """Compile with LLVM's optimisations, or without; without them, programs run six times as long."""
    name = "jax_disable_most_optimizations"
    before = jax.config.read(name)  # pyright: ignore[reportAttributeAccessIssue]
    jax.config.update(name, not wanted)
    try:
        yield
    finally:
        jax.config.update(name, before)
