"""Reconstructs many recordings. Finished ones are skipped, failures are reported at the end."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..pipeline import check_apart
from ._manifest import Manifest, Outcome
from ._method import Method
from ._one import finished_before
from ._places import check_places
from ._sources import Source
from ._workers import TIMEOUT, Finished, Progress, work_on


@dataclass(frozen=True)
class Shard:
    """One of several equal parts of a batch.

    Attributes:
        number: Number of the part, from 1.
    """

    number: int
    of: int

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not 1 <= self.number <= self.of:
            raise ValueError(f"shard {self.number}/{self.of}: give 1/n to n/n")

    def part(self, sources: Sequence[Source]) -> list[Source]:
        """Its recordings: every `of`-th, so that long neighbouring recordings are spread over the parts."""
        return list(sources[self.number - 1 :: self.of])


@dataclass(frozen=True)
class BatchResult:
    """Outcomes of the recordings of a batch.

    Attributes:
        before: Manifests of recordings that were done before, by name.
        now: Manifests of recordings processed now, by name.
    """

    before: dict[str, Manifest]
    now: dict[str, Manifest]

    @property
    def unsuccessful(self) -> dict[str, Manifest]:
        """Recordings that failed, and those without a pose in any frame."""
        every = self.before | self.now
        return {name: every[name] for name in sorted(every) if every[name].outcome is not Outcome.DONE}


def check_uncoupled(method: Method) -> None:
    """Refuse an objective that couples frames: a recording that was interrupted goes on at any batch of frames.

    Raises:
        ValueError: One line.
    """
    check_apart(method.settings, "but a batch goes on where it was interrupted; leave it out, or use `jaxskel run`")


def run_batch(
    sources: Sequence[Source],
    output: Path,
    method: Method | None = None,
    jobs: int = 1,
    request: str = "",
    on_event: Callable[[Progress | Finished], None] = lambda event: None,
    on_start: Callable[[int], None] = lambda before: None,
    timeout: float = TIMEOUT,
) -> BatchResult:
    """Reconstruct recordings, each into a folder of its name with `poses.npz`, `poses.csv` and `manifest.json`.

    A recording is skipped if it has a result and neither its files nor the settings nor this package have changed
    since. A failure does not affect the other recordings. An interrupted recording is resumed. Processes are spawned:
    a script that calls this needs ``if __name__ == "__main__":``.

    Only these files are written or replaced, one by one; other files in a result's folder stay as they are. Poses that
    somebody has changed are renamed before new ones are written.

    Args:
        sources: The recordings, see `find_sources`.
        output: Folder of the results.
        method: How to reconstruct.
        jobs: Number of processes, each on its own core.
        request: A new name to compute existing results again; empty: they are kept. Results already made for this
            name are kept, so that an interrupted request can be resumed.
        on_event: Called with each progress event.
        on_start: Called with the number of recordings done before.
        timeout: A process that gives no sign of life for this long (s) is killed; only its recording fails.

    Returns:
        A manifest for each recording.

    Raises:
        ValueError: `jobs` or `timeout` is not positive, or a result would overlap with an input, would replace
            somebody else's file, or cannot be written; or the objective couples frames.
    """
    if jobs < 1:
        raise ValueError(f"{jobs} jobs: give at least one")
    if not timeout > 0:
        raise ValueError(f"a timeout of {timeout:g} s: give a positive number of seconds")
    method = method or Method()
    check_uncoupled(method)
    check_places(sources, output, method.subject)
    before = {source.name: finished_before(source, output, method, request) for source in sources}
    there = {name: manifest for name, manifest in before.items() if manifest is not None}
    on_start(len(there))
    now = {}
    for event in work_on([s for s in sources if s.name not in there], output, method, jobs, request, timeout):
        if isinstance(event, Finished):
            now[event.source.name] = event.manifest
        on_event(event)
    return BatchResult(there, now)
