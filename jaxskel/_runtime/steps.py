"""Long work in steps, so that a stream may spread it over several frames.

What takes long is written as a generator that pauses after each step; its value is the result.
"""

from collections.abc import Generator
from typing import TypeVar

T = TypeVar("T")
Steps = Generator[None, None, T]
"""Work in steps; its value is the result."""


def finished(steps: Steps[T]) -> T:
    """The result of some work, all steps of it at once."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value
