"""The method that reconstructs the recordings of a batch."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import equinox as eqx

from ..io.recordings import read_people, read_recording, read_volumes
from ..io.subjects import read_body, read_subject
from ..people import hide_others
from ..pipeline import Settings
from ..recording import Recording
from ..volumes import Volumes
from ._described import described

_Given = TypeVar("_Given", Recording, Volumes)


@dataclass(frozen=True)
class Method:
    """The method that reconstructs the recordings of a batch. It is sent to other processes, so it must be pickled.

    Attributes:
        smooth_hz: Cutoff of the low-pass filter applied to the poses (Hz); None: not filtered.
        subject: TOML file with the dimensions of the one subject of all recordings; None: each has its own, or none.
        anyway: Whether to reconstruct even recordings whose views contradict each other too much.
    """

    settings: Settings = field(default_factory=Settings)
    smooth_hz: float | None = None
    subject: Path | None = None
    anyway: bool = False

    def read(self, source: Path, up: str | None = None, person: str | None = None) -> Recording:
        """Read a recording, with the subject if one is given; `up` as for `read_recording`.

        With the name of a `person`, of several who have masks of their own, it is theirs.

        Raises:
            ValueError: A subject is given, but there are several people; or as `read_recording` raises it.
        """
        if person is None:
            return self._completed(source, read_recording(source, up=up))
        return self.read_people(source)[person]

    def read_people(self, source: Path) -> dict[str, Recording]:
        """Read the recordings of people who have masks of their own, with what others hide, by name.

        Raises:
            ValueError: A subject is given; or as `jaxskel.io.read_people` raises it.
        """
        self.check_no_subject(source)
        return {name: self._completed(source, one) for name, one in hide_others(read_people(source)).items()}

    def check_no_subject(self, source: Path) -> None:
        """Refuse a subject, because a recording is of several people.

        Raises:
            ValueError: One line: a subject is given.
        """
        if self.subject is not None:
            raise ValueError(
                f"{source}: has several people, but --subject {self.subject} is one; name it in recording.toml"
            )

    def read_volumes(self, source: Path, up: str | None = None) -> Volumes:
        """Read volumes, with the subject if one is given; `up` as for `read_volumes`."""
        return self._completed(source, read_volumes(source, up=up))

    def _completed(self, source: Path, given: _Given) -> _Given:
        if self.smooth_hz is not None and not 0 < self.smooth_hz < given.fps / 2:
            raise ValueError(
                f"{source}: a cutoff of {self.smooth_hz:g} Hz; give one between 0 and {given.fps / 2:g} Hz, half "
                "the rate"
            )
        if self.subject is None:
            return given
        skeleton = read_subject(self.subject)
        return eqx.tree_at(lambda r: r.skeleton, given, skeleton, is_leaf=lambda leaf: leaf is None)

    def settings_for_subject(self) -> Settings:
        """The settings, with the body of the subject if one is given."""
        if self.subject is None:
            return self.settings
        body = read_body(self.subject)
        return eqx.tree_at(lambda s: s.body, self.settings, body, is_leaf=lambda leaf: leaf is None)

    @cached_property
    def described(self) -> dict[str, Any]:
        """Everything in it that affects the poses, as plain data; the subject's file counts as an input."""
        return {"settings": described(self.settings), "smooth_hz": self.smooth_hz}
