"""Detects changes of a recording's files while they are read."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Int, UInt8

from ..io.recordings import input_paths
from ..recording import AbstractSilhouettes
from ._inputs import moment, read_inputs
from ._manifest import Work, current_version
from ._method import Method
from ._sources import Source

# Number of frames read between two signs of life.
_FRAMES = 32


class Changed(Exception):
    """Files were changed while they were read."""


@dataclass(frozen=True)
class Reading:
    """State of a recording's files during reading. Make it before reading; afterwards `is_changed` compares."""

    source: Source
    method: Method
    on_sign: Callable[[str], None]

    def __post_init__(self) -> None:
        """Record the state of the files before anything is read."""
        assert self.moment
        assert self._around

    @cached_property
    def moment(self) -> str:
        """Digest of the state of the files."""
        return moment(_paths(self.source, self.method))

    @cached_property
    def work(self) -> Work:
        """What a result of these files depends on. Reads the files."""
        return current_work(self.source, self.method, None, lambda: self.on_sign("looking at its files"))

    @property
    def is_changed(self) -> bool:
        """Whether any of the files has changed since this was made, even if the change was undone."""
        try:
            return (self._now(), moment(_paths(self.source, self.method))) != (self._around, self.moment)
        except OSError:  # a file is gone
            return True

    @cached_property
    def _around(self) -> str:
        return self._now()

    def _now(self) -> str:
        return moment({"recording": self.source.path})


def current_work(
    source: Source, method: Method, known: Work | None = None, on_block: Callable[[], None] = lambda: None
) -> Work:
    """What a result would depend on now. Contents are not read again if they are unchanged since the known work."""
    inputs = read_inputs(_paths(source, method), None if known is None else known.inputs, on_block)
    return Work(str(source.path), inputs, method.described, current_version())


class Watched(AbstractSilhouettes):
    """Silhouettes that report each time when some of them have been read."""

    def __init__(self, silhouettes: AbstractSilhouettes, on_frames: Callable[[], None]):
        self._silhouettes, self._on_frames = silhouettes, on_frames
        self.shape = silhouettes.shape

    def read(self, frames: Int[np.ndarray, " some"]) -> UInt8[np.ndarray, "some cams h w8"]:
        """Read frames in separate runs of consecutive frames, because frames in gaps may have to be decoded too."""
        found = np.empty((len(frames), *self.shape[1:]), np.uint8)
        place = 0
        for run in np.split(frames, np.flatnonzero(np.diff(frames) != 1) + 1):
            for start in range(0, len(run), _FRAMES):
                some = run[start : start + _FRAMES]
                found[place : place + len(some)] = self._silhouettes.read(some)
                place += len(some)
                self._on_frames()
        return found


def _paths(source: Source, method: Method) -> dict[str, Path]:
    paths = input_paths(source.path)
    if method.subject is not None:
        paths["--subject"] = method.subject
    return paths
