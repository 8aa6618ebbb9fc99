"""Counts what this process compiles, so that a progress line can say what takes so long."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock


class Compilations:
    """Number of programs whose compilation has begun, and of those that are done; threads may count at once."""

    def __init__(self) -> None:
        self._lock = Lock()
        self.begun = 0
        self.done = 0

    @contextmanager
    def one_more(self) -> Iterator[None]:
        """A compilation, while the context is open."""
        with self._lock:
            self.begun += 1
        try:
            yield
        finally:
            with self._lock:
                self.done += 1

    def __str__(self) -> str:
        return f"compiling, once: {self.done} of {self.begun}" if self.done < self.begun else ""


COMPILATIONS = Compilations()
"""Those of this process."""
