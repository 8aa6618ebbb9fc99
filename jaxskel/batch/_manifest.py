"""`manifest.json`: the inputs, method and outcome of a result."""

import json
import socket
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from enum import StrEnum
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from .._runtime.atomic_files import written_whole
from .._runtime.code_digest import digest_of_definitions
from ..io.files import fault, open_regular, read_bounded
from ..poses import Poses
from ._inputs import Input, same_contents
from ._older_manifests import modern_method, modern_version

# Versions of these are recorded. A result depends on them too, but a new release is no reason to compute it again.
_LIBRARIES = ("jax", "jaxlib", "optimistix", "equinox", "numpy", "scipy", "opencv-python-headless")
_MAX_BYTES = 10_000_000
# First bytes of a manifest, which distinguish a damaged manifest from other people's files.
_BEGIN = b'{\n "outcome": "'


class Outcome(StrEnum):
    """Outcome of a recording."""

    DONE = "done"
    NO_POSE = "no pose"
    """Done, but without a pose in any frame."""
    FAILED = "failed"


@dataclass(frozen=True)
class Work:
    """Everything that a result depends on: the same work gives the same result."""

    source: str
    inputs: Mapping[str, Input]
    method: Mapping[str, Any]
    version: str

    def same(self, other: "Work") -> bool:
        """Whether the result is the same; the path of the recording does not matter."""
        mine, theirs = (self.method, self.version), (other.method, other.version)
        return mine == theirs and same_contents(self.inputs, other.inputs)


@dataclass(frozen=True)
class Manifest:
    """The inputs, method and outcome of a result.

    Attributes:
        problem: The problem, in one line.
        trace: Traceback of an unexpected error.
        counts: Number of frames of each status.
        seconds: Time of each part of the work (s).
        request: Name of the request to compute again for which it was made; empty if there was none.
        resumed: Frames that were already done when the work was last resumed.
        results: The files of the result; empty in manifests of versions that did not record them.
        note: Further remarks, in one line.
    """

    outcome: Outcome
    work: Work
    problem: str | None = None
    trace: str | None = None
    frames: int = 0
    with_pose: int = 0
    counts: Mapping[str, int] = field(default_factory=dict)
    confidence: float | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    request: str = ""
    resumed: int = 0
    results: Mapping[str, Input] = field(default_factory=dict)
    note: str = ""
    finished: str = ""
    host: str = ""
    libraries: Mapping[str, str] = field(default_factory=dict)

    @property
    def fps(self) -> float | None:
        """Frames per second of the reconstruction."""
        seconds, frames = self.seconds.get("reconstruct", 0.0), self.frames - self.resumed
        return frames / seconds if seconds > 0 and frames > 0 else None

    @property
    def told(self) -> str:
        """The outcome in one line."""
        if self.outcome is Outcome.FAILED:
            return f"failed: {self.problem}"
        fps = "" if self.fps is None else f", {self.fps:.1f} fps"
        resumed = f", {self.resumed} of them before" if self.resumed else ""
        note = f"; {self.note}" if self.note else ""
        return f"{self.frames} frames{resumed}, {self.with_pose} with a pose{fps}{note}"


def done(
    work: Work, poses: Poses, problem: str | None, seconds: Mapping[str, float], request: str, resumed: int
) -> Manifest:
    """The manifest of a reconstructed recording; `problem` is given if no frame has a pose."""
    sure = poses.typical_confidence
    return _stamped(Manifest(
        Outcome.NO_POSE if problem else Outcome.DONE, work, problem,
        frames=len(poses), with_pose=int(poses.has_pose.sum()), counts=poses.counts(),
        confidence=round(sure, 4) if sure == sure else None,
        seconds={name: round(value, 3) for name, value in seconds.items()}, request=request, resumed=resumed,
    ))  # fmt: skip


def failed(work: Work, problem: str, trace: str | None = None) -> Manifest:
    """The manifest of a recording that failed."""
    return _stamped(Manifest(Outcome.FAILED, work, " ".join(problem.split()), trace))


@cache
def current_version() -> str:
    """The package's version with a digest of its definitions, which change between releases, too."""
    return f"{version('jaxskel')}+{digest_of_definitions()[:12]}"


def write_manifest(path: Path, manifest: Manifest) -> None:
    """Write a manifest as JSON."""
    with written_whole(path) as file:
        file.write((json.dumps(asdict(manifest), indent=1) + "\n").encode())


def read_manifest(path: Path) -> Manifest:
    """Read a manifest.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    content = read_bounded(path, _MAX_BYTES, "a manifest")
    try:
        table: dict[str, Any] = json.loads(content)
        work = table["work"]
        work = work | {"method": modern_method(work["method"]), "version": modern_version(work["version"])}
        outcome, inputs, results = Outcome(table["outcome"]), _files(work["inputs"]), _files(table.get("results", {}))
        found = Manifest(**table | {"outcome": outcome, "work": Work(**work | {"inputs": inputs}), "results": results})
        numbers = (found.frames, found.with_pose, found.resumed, *found.counts.values(), *found.seconds.values())
        if not all(isinstance(number, int | float) for number in numbers):
            raise ValueError("counts or times are not numbers")
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise fault(path, None, f"is not a manifest of a batch ({error}); delete it and run again") from None
    return found


def is_manifest(path: Path) -> bool:
    """Whether a file is a manifest of a batch, possibly damaged; a link does not count."""
    if path.is_symlink():
        return False
    try:
        read_manifest(path)
        return True
    except (ValueError, OSError):
        pass
    try:
        with open_regular(path) as file:
            return file.read(len(_BEGIN)) == _BEGIN
    except (ValueError, OSError):
        return False


def _files(table: Mapping[str, Mapping[str, Any]]) -> dict[str, Input]:
    return {str(name): Input(**each) for name, each in table.items()}


def _stamped(manifest: Manifest) -> Manifest:
    return replace(
        manifest,
        finished=datetime.now(UTC).isoformat(timespec="seconds"),
        host=socket.gethostname(),
        libraries={name: version(name) for name in _LIBRARIES},
    )
