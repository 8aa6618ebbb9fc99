"""`jaxskel view`: shows a recording in an interactive 3D viewer."""

from pathlib import Path
from typing import Annotated

import typer

from ..io.poses import read_people_poses
from ..pipeline import HullSettings
from ..poses import Poses
from ..recording import Recording
from ._everybody import one_or_all, read_room
from ._outputs import check_output_file, files_of
from ._poseless import end_without_pose
from ._progress import progress_bar
from ._run import Box, MaxMisses, Preset, PresetOption, Recorded, Spacing, make_settings
from ._say import say


def view(
    source: Recorded,
    poses: Annotated[Path | None, typer.Argument(help="poses.npz as written by `jaxskel run`.")] = None,
    frames: Annotated[
        str,
        typer.Option(metavar="A:B", help="Frames A to B - 1 only, counted from 0; either may be left out."),
    ] = ":",
    save: Annotated[
        Path | None, typer.Option(help="File to write (.rrd) instead of opening a window: `rerun FILE.rrd` shows it.")
    ] = None,
    spacing: Spacing = HullSettings.spacing,
    max_misses: MaxMisses = None,
    box: Box = None,
    preset: PresetOption = Preset.DEFAULT,
) -> None:
    """Show hull, skeletal graph, labels, views and, where there are poses, the skeleton over time."""
    if save is not None and (save.suffix.lower() != ".rrd" or save.is_dir()):
        raise ValueError(f"{save}: the view is written to a file; give a name that ends in .rrd")
    try:
        from ..visualization.viewer import has_display, save_view, show_view
    except ImportError as error:
        raise ValueError(str(error)) from None
    if save is None and not has_display():
        raise ValueError(
            "there is no display to open a window on; give --save FILE.rrd, and open that file with `rerun FILE.rrd` "
            "where there is one"
        )
    settings = make_settings(preset, spacing, max_misses, box)
    inputs = [*files_of(source), *([] if poses is None else [poses])]
    if save is not None:
        check_output_file(save, inputs)
    recording, people = read_room(source), None if poses is None else read_people_poses(poses)
    found = None if people is None else one_or_all(people)
    chosen = _slice(frames, recording)
    progress, task = progress_bar("carving", len(recording))

    def on_frame(done: int, total: int) -> None:
        progress.update(task, description="carving, logging", completed=done, total=total)

    with progress:
        if save is None:
            count = show_view(recording, found, settings, chosen, on_frame)
        else:
            count = save_view(save, recording, found, settings, chosen, on_frame)
    what = f"{count} frames, {len(recording.cameras)} views, {_shown(people)}"
    if save is None:
        say(f"{source}: {what}, shown in the window of rerun")
    else:
        say(f"{save}: {what}, {save.stat().st_size / 1e6:.1f} MB; `rerun {save}` shows it")
    if poses is not None and people is not None:
        end_without_pose(poses, *people.values())


def _shown(people: dict[str, Poses] | None) -> str:
    if people is None:
        return "no poses"
    return "with poses" if len(people) == 1 else f"with poses of {len(people)} people"


def _slice(frames: str, recording: Recording) -> slice:
    """Parse ``A:B`` to a slice of frames."""
    start, colon, stop = frames.partition(":")
    if colon and all(part == "" or part.isdecimal() for part in (start, stop)):
        chosen = slice(int(start or 0), int(stop or len(recording)))
        if chosen.start < chosen.stop <= len(recording):
            return chosen
    raise ValueError(f"--frames {frames}: give A:B with 0 <= A < B <= {len(recording)}, as in 0:{len(recording)}")
