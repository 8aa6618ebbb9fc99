"""`jaxskel batch`: computes poses for many recordings."""

import os
import sys
import time
from pathlib import Path
from typing import Annotated
from uuid import uuid4

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from .._runtime.cores import usable_cores
from ..batch import (
    PROCESS_BYTES,
    TIMEOUT,
    BatchResult,
    Finished,
    Manifest,
    Method,
    Outcome,
    Shard,
    check_places,
    check_uncoupled,
    find_sources,
    run_batch,
)
from ..batch import Progress as Frames
from ..io.subjects import read_subject
from ..pipeline import HullSettings
from ._objective import ObjectiveOption, with_objective
from ._outputs import check_output
from ._run import Box, MaxMisses, Preset, PresetOption, Smooth, Spacing, Subject, Track, make_settings
from ._say import cell, say, warn
from ._slurm import stop_when_told, submit
from ._template import TemplateOption, template_of
from ._verdict import Anyway


def batch(
    inputs: Annotated[
        list[str],
        typer.Argument(metavar="INPUTS...", help="Recordings, folders of them, patterns, or text files with a list."),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write to: a folder for each recording.")],
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", "-j", min=1, help="Number of processes. Default: by cores and memory."),
    ] = None,
    shard: Annotated[str | None, typer.Option(metavar="I/N", help="Only the I-th of N parts.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Compute finished recordings again.")] = False,
    timeout: Annotated[
        float, typer.Option(help="A process without a sign of life for this long (s) is ended; its recording fails.")
    ] = TIMEOUT,
    slurm: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Submit to Slurm as an array of N tasks, and return.")
    ] = None,
    slurm_minutes: Annotated[int, typer.Option(min=1, help="Time limit of a task (min).")] = 1440,
    slurm_option: Annotated[
        list[str] | None, typer.Option(metavar="KEY=VALUE", help="Option of sbatch, such as partition=long.")
    ] = None,
    subject: Subject = None,
    spacing: Spacing = HullSettings.spacing,
    max_misses: MaxMisses = None,
    box: Box = None,
    preset: PresetOption = Preset.DEFAULT,
    track: Track = False,
    smooth_hz: Smooth = None,
    anyway: Anyway = False,
    objective: ObjectiveOption = None,
    template: TemplateOption = None,
) -> None:
    """Reconstruct many recordings. When run again, it continues with those that are not done or have changed."""
    if not timeout > 0:
        raise ValueError(f"--timeout {timeout:g}: give a positive number of seconds")
    check_output(output)
    every = find_sources(inputs)
    sources = every if shard is None else _shard(shard).part(every)
    # Absolute, because a node of a cluster may start in another folder.
    settings = make_settings(preset, spacing, max_misses, box, track, template_of(template))
    settings = with_objective(settings, None if objective is None else objective.absolute())
    if subject is not None:
        read_subject(subject)  # check now, since its faults concern all recordings
    method = Method(settings, smooth_hz, subject, anyway)
    check_uncoupled(method)
    request = uuid4().hex if force else ""
    if shard is not None or slurm is not None:  # each process sees only its own part
        check_places(every, output, subject)
    if slurm is not None:
        say(submit(sources, output, method, jobs or 1, request, timeout, slurm, slurm_minutes, slurm_option or []))
        return
    stop_when_told()
    begin = time.monotonic()
    try:
        with _Display(len(sources)) as display:
            jobs = jobs or _fitting_jobs()
            found = run_batch(sources, output, method, jobs, request, display.event, display.start, timeout)
    except KeyboardInterrupt:
        warn(f"{output}: interrupted; the same command goes on from here")
        raise typer.Exit(130) from None
    problems = found.unsuccessful
    if problems:
        Console().print(_problems(problems))
    say(_summary(output, found, time.monotonic() - begin))
    if problems:
        raise typer.Exit(1)


class _Display:
    """Progress on standard error: a bar on a terminal, otherwise a line for each recording."""

    def __init__(self, total: int):
        self._console = Console(stderr=True)
        self._progress = Progress(
            TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
            TimeRemainingColumn(), console=self._console, refresh_per_second=2, speed_estimate_period=600,
        )  # fmt: skip
        self._total, self._done, self._failed = total, 0, 0
        self._parts: dict[str, float] = {}
        self._task = self._progress.add_task("recordings", total=total)

    def __enter__(self) -> "_Display":
        if self._console.is_terminal:
            self._progress.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._progress.stop()

    def start(self, before: int) -> None:
        """Exclude recordings that are already done."""
        self._total -= before
        self._progress.reset(self._task, total=self._total)
        if before:
            self._console.print(f"{before} recordings are done already", highlight=False)

    def event(self, event: Frames | Finished) -> None:
        """Show the progress."""
        if isinstance(event, Frames):
            self._parts[event.source.name] = event.done / max(event.total, 1)
        else:
            self._parts.pop(event.source.name, None)
            self._done += 1
            self._failed += event.manifest.outcome is Outcome.FAILED
            if not self._console.is_terminal:
                print(event.told(self._done, self._total), file=sys.stderr, flush=True)
            elif event.manifest.note:
                self._console.print(cell(f"{event.source.name}: {event.manifest.note}"))
        failed = f", {self._failed} failed" if self._failed else ""
        done = self._done + sum(self._parts.values())
        self._progress.update(self._task, completed=done, description=f"recordings{failed}")


def _problems(problems: dict[str, Manifest]) -> Table:
    table = Table(title="without a usable result")
    for column in ("recording", "outcome", "cause"):
        table.add_column(column, overflow="fold")
    for name, manifest in problems.items():
        table.add_row(cell(name), cell(manifest.outcome), cell(manifest.problem or ""))
    return table


def _summary(output: Path, found: BatchResult, seconds: float) -> str:
    failed = sum(m.outcome is Outcome.FAILED for m in found.now.values())
    empty = len(found.unsuccessful) - failed
    every = len(found.before) + len(found.now)
    kinds = (f", {empty} without a pose" if empty else "") + (f", {failed} failed" if failed else "")
    frames = sum(m.frames - m.resumed for m in found.now.values())
    return (
        f"{output}: {every} recordings, {every - failed - empty} done ({len(found.before)} of them before){kinds}; "
        f"{frames} frames in {seconds:.0f} s"
    )


def _shard(text: str) -> Shard:
    number, slash, of = text.partition("/")
    if not (slash and number.isdecimal() and of.isdecimal()):
        raise ValueError(f"--shard {text}: give the number of the part and how many there are, such as 1/4")
    return Shard(int(number), int(of))


def _fitting_jobs() -> int:
    cores = usable_cores()
    try:
        fitting = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // PROCESS_BYTES
    except (AttributeError, OSError, ValueError):
        return cores
    return max(1, min(cores, fitting))
