"""Many recordings: what is done is left alone, what fails is told at the end."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ._manifest import Manifest, Outcome
from ._method import Method
from ._one import finished_before
from ._places import check_places
from ._sources import Source
from ._workers import TIMEOUT, Finished, Progress, work_on


@dataclass(frozen=True)
class Shard:
    """One of several equal parts of a batch."""

    number: int
    """From 1."""
    of: int

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not 1 <= self.number <= self.of:
            raise ValueError(f"shard {self.number}/{self.of}: give 1/n to n/n")

    def part(self, sources: Sequence[Source]) -> list[Source]:
        """Its recordings: every `of`-th, so that long ones that lie together are spread."""
        return list(sources[self.number - 1 :: self.of])


@dataclass(frozen=True)
class BatchResult:
    """What became of the recordings of a batch."""

    before: dict[str, Manifest]
    """Those whose result was there, by name."""
    now: dict[str, Manifest]
    """Those that were worked on."""

    @property
    def unsuccessful(self) -> dict[str, Manifest]:
        """Those that failed, and those without a pose in any frame."""
        every = self.before | self.now
        return {name: every[name] for name in sorted(every) if every[name].outcome is not Outcome.DONE}


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

    A recording is left alone where its result is there and neither its files nor the settings nor this package have
    changed since. One that fails does not harm the others; one that was broken off goes on from there. Processes
    are spawned: a script that calls this needs ``if __name__ == "__main__":``.

    Only these files are written or replaced, one by one; what else is in a result's folder stays as it is. Poses that
    somebody has changed since are renamed before new ones take their place.

    Args:
        sources: The recordings, see `find_sources`.
        output: Folder of the results.
        method: How to reconstruct.
        jobs: Processes at once, each on a core of its own.
        request: Compute again what is there: a name for this, any that is new. What answers a request of the same
            name already is left alone, so that one that was broken off goes on.
        on_event: Told how it goes.
        on_start: Told how many were done before.
        timeout: A process that gives no sign of life for so long (s) is killed, which costs its recording only.

    Returns:
        A manifest for each recording.

    Raises:
        ValueError: There are no jobs or no time, or a result would meet an input, would replace a file of somebody
            else's, or cannot be written.
    """
    if jobs < 1:
        raise ValueError(f"{jobs} jobs: give at least one")
    if not timeout > 0:
        raise ValueError(f"a timeout of {timeout:g} s: give a positive number of seconds")
    method = method or Method()
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
