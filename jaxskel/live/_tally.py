"""What a live session counts. Its memory does not grow, however long the session is."""

from collections import deque
from dataclasses import dataclass

import numpy as np

# Latencies are counted in steps of this length (s), up to the longest one; longer ones count as that.
_STEP, _LONGEST = 5e-4, 10.0
_TO_MEASURE = 2.0  # s that a rate needs to be told
_RECENT = 50  # frames over which the current rate and latency are told


@dataclass(frozen=True)
class Moment:
    """How a session stands when a frame is handed on.

    Attributes:
        time: When the frame was taken, since the session's first one, by the number of the frame (s).
        number: Number of the frame, from 0.
        dropped: Frames that were left out so far.
        fps: Frames per second at present.
        latency: Median latency at present (s), see `Tally`.
    """

    time: float
    number: int
    dropped: int
    fps: float
    latency: float

    def __str__(self) -> str:
        return (
            f"frame {self.number}, {self.time:.1f} s, {self.fps:.1f} fps, latency {1e3 * self.latency:.0f} ms, "
            f"{self.dropped} dropped"
        )


class Tally:
    """Counts frames, dropped frames, and latencies: the times from when a frame was taken to when all have its pose."""

    def __init__(self, fps: float):
        self._fps = fps
        self._counts = np.zeros(round(_LONGEST / _STEP) + 1, np.int64)
        self._recent: deque[tuple[float, float]] = deque(maxlen=_RECENT)
        self._last = -1
        self._span: tuple[float, float] | None = None  # when the first and the last frame were taken (s)
        self.frames = 0
        """Number of frames with a pose or a status."""

    @property
    def dropped(self) -> int:
        """Number of frames that were left out."""
        return self._last + 1 - self.frames

    def begin(self, number: int) -> Moment:
        """Count the frame of this number, and say how things stand."""
        self._last = number
        self.frames += 1
        times, latencies = ([], []) if not self._recent else zip(*self._recent, strict=True)
        passed = times[-1] - times[0] if times else 0.0
        fps = (len(times) - 1) / passed if passed > 0 else 0.0
        latency = float(np.median(latencies)) if latencies else 0.0
        return Moment(number / self._fps, number, self.dropped, fps, latency)

    def end(self, taken: float, now: float) -> None:
        """Count the latency of a frame that all have now."""
        self._span = (taken if self._span is None else self._span[0], taken)
        latency = max(0.0, now - taken)
        self._counts[min(round(latency / _STEP), len(self._counts) - 1)] += 1
        self._recent.append((now, latency))

    @property
    def rate(self) -> float | None:
        """Frames per second of the source, with the dropped ones; None as long as it cannot be told."""
        passed = 0.0 if self._span is None else self._span[1] - self._span[0]
        return self._last / passed if passed > _TO_MEASURE else None

    def latency(self, share: float) -> float:
        """The latency (s) that this share of the frames did not exceed; NaN without a frame."""
        if not self._counts.any():
            return float("nan")
        reached = np.cumsum(self._counts) >= share * self._counts.sum()
        return _STEP * int(np.argmax(reached))

    def __str__(self) -> str:
        share = self.dropped / max(1, self._last + 1)
        return (
            f"{self.dropped} dropped ({share:.1%}), latency {1e3 * self.latency(0.5):.0f} ms, "
            f"in 99 % of the frames below {1e3 * self.latency(0.99):.0f} ms"
        )
