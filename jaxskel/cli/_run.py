"""`jaxskel run`: computes the poses of a recording."""

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from ..batch import Method
from ..body import Skeleton
from ..io.poses import write_poses
from ..io.recordings import holds_volumes, read_data
from ..pipeline import HullSettings, Settings, advice, advice_for_volumes, check_apart, paper_settings
from ..poses import smooth
from ..recording import UP_AXES
from ..search import Tracking
from ..verdict import doubts_before_work
from ._objective import ObjectiveOption, with_objective
from ._outputs import check_output as check_output
from ._outputs import check_output_file as check_output_file
from ._outputs import files_of
from ._progress import StageTimes, doubt, reconstruct_with_progress, summary, volumes_with_progress
from ._ranges import check_number
from ._run_people import are_several, run_people
from ._say import say, warn
from ._template import TemplateOption, files_of_template, found_subject, template_of
from ._verdict import Anyway

MOST_JOBS = 256
"""Largest number of processes: the cores of a large machine, and some to spare."""
POSES_FILES = ("poses.npz", "poses.csv")
_FARTHEST = 1e4  # m; nobody is recorded farther away

Recorded = Annotated[
    Path, typer.Argument(metavar="RECORDING", help="Folder with a recording.toml, sequence file, voxel file or mesh.")
]
Spacing = Annotated[float, typer.Option(help="Edge length of a voxel (m).")]
Box = Annotated[
    tuple[float, float, float, float, float, float] | None,
    typer.Option(help="Lower x, y, z and upper x, y, z of what to carve, in the input's world (m)."),
]
Subject = Annotated[Path | None, typer.Option(help="TOML file with the subject's dimensions.")]
Track = Annotated[bool, typer.Option("--track", help="Frames are consecutive: follow the person.")]
Smooth = Annotated[
    float | None, typer.Option("--smooth", help="Low-pass filter the poses with this cutoff (Hz); off by default.")
]


class Preset(StrEnum):
    """Named settings."""

    DEFAULT = "default"
    PAPER = "paper"


PresetOption = Annotated[
    Preset, typer.Option(help="default, or paper: as the paper describes it (the head is the highest voxel).")
]
MaxMisses = Annotated[
    int | None,
    typer.Option(help="Cameras that may see background at an occupied voxel. Default: judged from the masks."),
]


def run(
    source: Recorded,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write to.")],
    subject: Subject = None,
    spacing: Spacing = HullSettings.spacing,
    max_misses: MaxMisses = None,
    box: Box = None,
    preset: PresetOption = Preset.DEFAULT,
    track: Track = False,
    template: TemplateOption = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Number of processes, each on its own core.")] = 1,
    smooth_hz: Smooth = None,
    anyway: Anyway = False,
    objective: ObjectiveOption = None,
    data: Annotated[
        Path | None, typer.Option(help="Arrays with a row for each frame (.npz), for the terms of the objective.")
    ] = None,
    up: Annotated[
        str | None,
        typer.Option(help="World axis that points up in voxels or a mesh; by default what the file says."),
    ] = None,
    people: Annotated[
        str | None,
        typer.Option(
            metavar="NUMBER|all",
            help="Tell so many people apart, in silhouettes that show them as one mask. Default: one, or those that "
            "recording.toml names.",
        ),
    ] = None,
) -> None:
    """Reconstruct every frame; write poses.npz and poses.csv, of several people a table for each."""
    settings = with_objective(make_settings(preset, spacing, max_misses, box, track, template_of(template)), objective)
    method = Method(settings, smooth_hz, subject)
    check_number("--smooth", smooth_hz, 1e-3, 1e6, "a cutoff in Hz")
    check_number("--jobs", jobs, 1, MOST_JOBS, "a number of processes")
    if jobs > 1:
        check_apart(settings, "but several processes take batches apart; leave out --jobs, or the term")
    if up is not None:
        _check_up(up, source)
    several = are_several(source, people)
    if several and data is not None:
        raise ValueError("--data: is of one person, but there are several; leave it out")
    others = [path for path in (subject, objective, data) if path is not None] + files_of_template(template)
    if several:
        run_people(source, output, method, people, jobs, others, anyway)
        return
    check_output(output, POSES_FILES, [*files_of(source), *others])
    settings, times = method.settings_for_subject(), StageTimes()
    if preset is Preset.PAPER and holds_volumes(source):
        refuse_carving(source, spacing, max_misses, box, jobs)
        if data is not None:
            raise ValueError(f"--data: --preset paper takes the voxels of {source} as they are; leave it out")
        given = method.read_volumes(source, up)
        poses = volumes_with_progress(given, settings, times)
        problem = advice_for_volumes(poses)
    else:
        given = method.read(source, up)
        if data is not None:
            given = read_data(data, given)
        for told in doubts_before_work(source, given, anyway):
            warn(told)
        poses = reconstruct_with_progress(given, settings, times, jobs)[0]
        problem = advice(poses, given)
    if smooth_hz is not None:
        poses = smooth(poses, smooth_hz)
    archive, table = write_poses(output, poses)
    if given.skeleton is None:
        say(f"{given.name}: {found_subject(poses)}")
    say(f"{archive}, {table}: {summary(poses, times)}")
    warning = doubt(poses, settings)
    if warning:
        warn(f"{source}: {warning}")
    if problem:
        warn(f"{source}: {problem}")
        raise typer.Exit(1)


def _check_up(up: str, source: Path) -> None:
    """Refuse what is no axis, and an axis for recordings that say their own."""
    if up not in UP_AXES:
        raise ValueError(f"--up {up}: give one of {', '.join(UP_AXES)}")
    if not holds_volumes(source):
        raise ValueError(f"--up: is for voxels and meshes, but {source} says its own; leave it out")


def refuse_carving(
    source: Path, spacing: float, max_misses: int | None, box: tuple[float, ...] | None, jobs: int
) -> None:
    """Refuse options of carving, and several processes, where the graph is taken from the voxels as they are."""
    given = {"--spacing": spacing != HullSettings.spacing, "--max-misses": max_misses is not None,
             "--box": box is not None, "--jobs": jobs != 1}  # fmt: skip
    for option, is_given in given.items():
        if is_given:
            raise ValueError(
                f"{option}: is for silhouettes; --preset paper takes the voxels of {source} as they are; leave it out"
            )


def make_settings(
    preset: Preset,
    spacing: float,
    max_misses: int | None,
    box: tuple[float, ...] | None,
    track: bool = False,
    template: Skeleton | None = None,
) -> Settings:
    """Make settings from options."""
    if track and preset is Preset.PAPER:
        raise ValueError("--track: the paper's method treats each frame by itself; leave out --track or --preset")
    check_number("--spacing", spacing, 1e-3, 1.0, "the edge of a voxel in metres")
    check_number("--max-misses", max_misses, 0, 1000, "a number of cameras")
    if template is not None and preset is not Preset.PAPER and not template.template.is_human:
        raise ValueError(
            f"--template: {template.template.name!r} has points that are not on the human body, as the search needs; "
            "add --preset paper"
        )
    base = paper_settings(template) if preset is Preset.PAPER else Settings(template=template)
    corners = None if box is None else _corners(box)
    misses = base.hull.max_misses if max_misses is None else max_misses
    hull = replace(base.hull, spacing=spacing, max_misses=misses, box=corners)
    return replace(base, hull=hull, tracking=Tracking() if track else None)


def _corners(box: tuple[float, ...]) -> np.ndarray:
    """Lower and upper corner of the box (world, m)."""
    for value in box:
        check_number("--box", value, -_FARTHEST, _FARTHEST, "lower x, y, z and upper x, y, z in metres")
    corners = np.array(box, np.float64).reshape(2, 3)
    if not (corners[0] < corners[1]).all():
        told = " ".join(f"{value:g}" for value in box)
        raise ValueError(f"--box {told}: give the lower x, y, z and then the upper ones, which must be larger")
    return corners
