"""Reconstruction with a progress bar, and the summary line that follows it."""

import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from jaxtyping import Int
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from .._runtime.compilations import COMPILATIONS
from ..pipeline import (
    Prepared,
    Settings,
    prepare,
    reconstruct_batches,
    reconstruct_parallel,
    reconstruct_volumes,
)
from ..poses import STATUS_NAMES, Poses, Status, join_poses
from ..recording import Recording
from ..volumes import Volumes

# Typical confidence below which poses are doubtful: such a joint is as likely to be elsewhere.
_DOUBTFUL = 0.5


class StageTimes:
    """Seconds spent in each stage, with those of the first batch, which compiles, kept apart."""

    def __init__(self) -> None:
        self.first: dict[str, float] = {}
        self.later: dict[str, float] = defaultdict(float)
        self.later_frames = 0
        self._inner = 0.0

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        start, outer = time.perf_counter(), self._inner
        self._inner = 0.0
        yield
        elapsed = time.perf_counter() - start
        # Do not count nested stages twice.
        self.later[stage] += elapsed - self._inner
        self._inner = outer + elapsed

    def end_of_batch(self, frames: int) -> None:
        """Count the frames of a batch; all time before the end of the first one is start-up."""
        if self.first:
            self.later_frames += frames
        else:
            self.first, self.later = dict(self.later), defaultdict(float)

    def __str__(self) -> str:
        text = f"start-up {sum(self.first.values()):.1f} s"
        # Frames without any person skip all stages and take no time.
        if self.later_frames and sum(self.later.values()) > 0:
            text += f", then {self.later_frames / sum(self.later.values()):.1f} fps"
        return text


class _Compiling(ProgressColumn):
    """Says what takes so long the first time."""

    def render(self, task: Task) -> Text:
        """The number of programs that are compiled."""
        return Text(str(COMPILATIONS))


def progress_bar(what: str, total: int) -> tuple[Progress, TaskID]:
    """A progress bar on standard error, so that the output stays clean for scripts."""
    progress = Progress(
        TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
        _Compiling(), console=Console(stderr=True), refresh_per_second=2,
    )  # fmt: skip
    return progress, progress.add_task(what, total=total)


def reconstruct_with_progress(
    recording: Recording, settings: Settings, times: StageTimes, jobs: int = 1, who: str = ""
) -> tuple[Poses, Prepared]:
    """Reconstruct a recording behind a progress bar, which begins with `who` it is."""
    progress, task = progress_bar(f"{who}fitting the body", len(recording))
    with progress:
        with times("prepare"):
            prepared = prepare(recording, settings)
        progress.update(task, description=f"{who}reconstructing")
        parts = []
        if jobs == 1:
            batches = reconstruct_batches(recording, settings, prepared, times)
        else:
            batches = _timed(reconstruct_parallel(recording, jobs, settings, prepared), times)
        for part in batches:
            parts.append(part)
            times.end_of_batch(len(part))
            progress.advance(task, len(part))
    return join_poses(parts), prepared


def volumes_with_progress(volumes: Volumes, settings: Settings, times: StageTimes) -> Poses:
    """Reconstruct volumes behind a progress bar."""
    progress, task = progress_bar("reconstructing", len(volumes))
    with progress:
        parts = []
        for part in reconstruct_volumes(volumes, settings, times):
            parts.append(part)
            times.end_of_batch(len(part))
            progress.advance(task, len(part))
    return join_poses(parts)


def _timed(batches: Iterator[Poses], times: StageTimes) -> Iterator[Poses]:
    """The batches, while measuring the wait for each."""
    while True:
        with times("wait"):
            part = next(batches, None)
        if part is None:
            return
        yield part


def summary(poses: Poses, times: StageTimes | str) -> str:
    """Frames, statuses other than ok, start-up time and frames per second or what else is to be told, in one line."""
    with_pose = int(poses.has_pose.sum())
    sure = f", confidence {poses.typical_confidence:.2f}" if with_pose else ""
    return (
        f"{len(poses)} frames, {with_pose} with a pose{_kinds(poses.status[poses.has_pose])}, "
        f"{len(poses) - with_pose} without{_kinds(poses.status[~poses.has_pose])}{sure}; {times}"
    )


def _kinds(statuses: Int[np.ndarray, " frames"]) -> str:
    kinds, counts = np.unique(statuses[statuses != Status.OK], return_counts=True)
    notes = [f"{count} {STATUS_NAMES[kind]}" for kind, count in zip(kinds, counts, strict=True)]
    return f" ({', '.join(notes)})" if notes else ""


def doubt(poses: Poses, settings: Settings) -> str | None:
    """Advice if most poses are unreliable; None otherwise."""
    if not poses.has_pose.any() or poses.typical_confidence > _DOUBTFUL:
        return None
    if settings.search is None:
        return "most poses have a low confidence: leave out --preset paper, which places limbs by the graph alone"
    return "most poses have a low confidence: do the silhouettes show more than the person, a chair for instance?"
