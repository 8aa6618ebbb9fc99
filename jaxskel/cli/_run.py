"""`jaxskel run`: a recording to poses."""

import sys
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from .._advice import advice
from .._settings import Settings, paper_settings
from .._smooth import smooth
from .._track import Tracking
from ..batch import Method
from ..io import write_poses
from ._progress import StageTimes, doubt, reconstruct_with_progress, summary
from ._verdict import Anyway, check_views

Recorded = Annotated[Path, typer.Argument(metavar="RECORDING", help="Folder with a recording.toml, or sequence file.")]
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
    typer.Option(min=0, help="Cameras that may see background at an occupied voxel. Default: judged from the masks."),
]


def run(
    source: Recorded,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write to.")],
    subject: Subject = None,
    spacing: Spacing = Settings.spacing,
    max_misses: MaxMisses = None,
    box: Box = None,
    preset: PresetOption = Preset.DEFAULT,
    track: Track = False,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Processes at once, each on a core of its own.")] = 1,
    smooth_hz: Smooth = None,
    anyway: Anyway = False,
) -> None:
    """Reconstruct every frame; write poses.npz and poses.csv."""
    method = Method(make_settings(preset, spacing, max_misses, box, track), smooth_hz, subject)
    recording = method.read(source)
    check_output(output)
    check_views(source, recording, anyway)
    settings = method.settings_for_subject()
    times = StageTimes()
    poses, prepared = reconstruct_with_progress(recording, settings, times, jobs)
    if smooth_hz is not None:
        poses = smooth(poses, smooth_hz)
    archive, table = write_poses(output, poses)
    if not prepared.skeleton_is_known:
        print(f"{recording.name}: unknown subject, an average adult of {prepared.skeleton.stature:.2f} m was fitted")
    print(f"{archive}, {table}: {summary(poses, times)}")
    warning = doubt(poses, settings)
    if warning:
        print(f"jaxskel: {source}: {warning}", file=sys.stderr)
    problem = advice(poses, recording)
    if problem:
        print(f"jaxskel: {source}: {problem}", file=sys.stderr)
        raise typer.Exit(1)


def make_settings(
    preset: Preset, spacing: float, max_misses: int | None, box: tuple[float, ...] | None, track: bool = False
) -> Settings:
    """Settings from options."""
    if track and preset is Preset.PAPER:
        raise ValueError("--track: the paper's method treats each frame by itself; leave out --track or --preset")
    base = paper_settings() if preset is Preset.PAPER else Settings()
    corners = None if box is None else np.array(box, np.float64).reshape(2, 3)
    misses = base.max_misses if max_misses is None else max_misses
    tracking = Tracking() if track else None
    return replace(base, spacing=spacing, max_misses=misses, box=corners, tracking=tracking)


def check_output(folder: Path) -> None:
    """Refuse an output that is no folder before any work is done."""
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"{folder}: the output must be a folder, but this is a file; choose another name")


def check_output_file(path: Path) -> None:
    """Refuse an output that is no file before any work is done."""
    if path.is_dir():
        raise ValueError(f"{path}: the output must be a file, but this is a folder; choose another name")
