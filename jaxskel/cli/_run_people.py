"""`jaxskel run` of several people in one room."""

from collections.abc import Iterable
from pathlib import Path

import typer

from ..batch import Method
from ..io.poses import tables_of, write_people_archive, write_table
from ..io.recordings import holds_people
from ..people import MOST_PEOPLE, tell_people_apart
from ..pipeline import Settings
from ..poses import Poses, smooth
from ..recording import Recording
from ..verdict import doubts_before_work
from ._outputs import check_output, files_of
from ._progress import StageTimes, progress_bar, reconstruct_with_progress, summary
from ._say import say, warn
from ._template import found_subject

ALL = "all"
"""Value of the option ``--people`` for as many as there are."""


def are_several(source: Path, people: str | None) -> bool:
    """Whether a recording is of several people, by its masks or by the option.

    Raises:
        ValueError: The option makes no sense, or is given for people who have masks of their own.
    """
    if people is not None and people != ALL and not (people.isdecimal() and 1 <= int(people) <= MOST_PEOPLE):
        raise ValueError(f"--people {people}: give a number from 1 to {MOST_PEOPLE}, or {ALL}")
    named = holds_people(source)
    if named and people is not None:
        raise ValueError(f"--people: is for masks that show everybody; {source} has masks of each person; leave it out")
    return named or people not in (None, "1")


def run_people(
    source: Path,
    output: Path,
    method: Method,
    people: str | None,
    jobs: int,
    others: Iterable[Path],
    anyway: bool,
) -> None:
    """Reconstruct everybody, one after the other; write poses.npz and a table for each person as they are done.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    method.check_no_subject(source)
    inputs = [*files_of(source), *others]
    check_output(output, ("poses.npz",), inputs)
    found = _people_in(source, method, people)
    if not found:
        warn(f"{source}: nobody is seen in enough views; do the silhouettes fit the calibration?")
        raise typer.Exit(1)
    tables = [output / table for table in tables_of(found)]
    check_output(output, ("poses.npz", *(table.name for table in tables)), inputs)
    # Of people told apart in common masks, a contradiction may come of that, and each frame has a status.
    anyway = anyway or not holds_people(source)
    for name, recording in found.items():
        for told in doubts_before_work(f"{source}: {name}", recording, anyway):
            warn(told)
    settings, archive, poses = method.settings_for_subject(), output / "poses.npz", {}
    for (name, recording), table in zip(found.items(), tables, strict=True):
        times = StageTimes()
        poses[name] = _reconstructed(name, recording, settings, method.smooth_hz, times, jobs)
        if recording.skeleton is None:
            say(f"{name}: {found_subject(poses[name])}")
        say(f"{name}: {summary(poses[name], times)}")
        # What is done is kept if the next person is not.
        write_people_archive(archive, poses)
        write_table(table, poses[name])
    count = "1 person" if len(poses) == 1 else f"{len(poses)} people"
    say(f"{archive}, {', '.join(map(str, tables))}: {count}: {', '.join(poses)}")
    missed = [name for name, each in poses.items() if not each.has_pose.any()]
    if missed:
        warn(f"{source}: no frame has a pose of {', '.join(missed)}")
        raise typer.Exit(1)


def _people_in(source: Path, method: Method, people: str | None) -> dict[str, Recording]:
    """The recording of each person, told apart by masks or by the bodies of the hull."""
    if holds_people(source):
        return method.read_people(source)
    recording = method.read(source)
    progress, task = progress_bar("telling people apart", len(recording))
    with progress:
        return tell_people_apart(
            recording, None if people in (None, ALL) else int(people),
            lambda done: progress.update(task, completed=done),
        )  # fmt: skip


def _reconstructed(
    name: str, recording: Recording, settings: Settings, smooth_hz: float | None, times: StageTimes, jobs: int
) -> Poses:
    poses = reconstruct_with_progress(recording, settings, times, jobs, f"{name}: ")[0]
    return poses if smooth_hz is None else smooth(poses, smooth_hz)
