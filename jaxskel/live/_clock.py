"""The clock that a live session goes by: tests have one of their own."""

import time
from threading import Event
from typing import Protocol, runtime_checkable


@runtime_checkable
class Clock(Protocol):
    """Time, and waiting for it."""

    def now(self) -> float:
        """The time (s) since any moment."""
        ...

    def sleep(self, seconds: float) -> None:
        """Wait; return earlier where the session is to end."""
        ...

    def stopped(self) -> bool:
        """Whether the session is to end."""
        ...


class WallClock:
    """The time of this machine, until the session is ended."""

    def __init__(self) -> None:
        self._stop = Event()

    def now(self) -> float:
        """The time (s), which is never set back."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait; return earlier where the session is ended."""
        self._stop.wait(max(0.0, seconds))

    def stop(self) -> None:
        """End the session after the frame that is being worked on; any thread and a signal may do so."""
        self._stop.set()

    def stopped(self) -> bool:
        """Whether the session is to end."""
        return self._stop.is_set()
