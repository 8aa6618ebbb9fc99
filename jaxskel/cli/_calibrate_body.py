"""`jaxskel calibrate-body`: estimates a subject's bone lengths and radii from a recording."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from ..io.files import is_ours
from ..io.recordings import SUBJECT_FILE, read_recording
from ..io.subjects import write_subject
from ..pipeline import FRAMES, STAGES, CalibratedBody, HullSettings
from ..pipeline import calibrate_body as found_body
from ._outputs import chosen_file, files_of
from ._progress import progress_bar
from ._run import MaxMisses, Preset, Recorded, Spacing, make_settings
from ._say import say


def calibrate_body(
    source: Recorded,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="TOML file to write, for `run --subject`.", show_default="subject.toml"),
    ] = None,
    frames: Annotated[int, typer.Option(min=8, help="Frames to use, spread evenly.")] = FRAMES,
    spacing: Spacing = HullSettings.spacing,
    max_misses: MaxMisses = None,
) -> None:
    """Find the subject's bone lengths and radii from the silhouettes; dimensions in the recording are ignored."""
    settings = make_settings(Preset.DEFAULT, spacing, max_misses, None)
    # Dimensions found by an earlier run are not read, so they may be replaced.
    inputs = [path for path in files_of(source) if not (path.name == SUBJECT_FILE and is_ours(path))]
    output = chosen_file(output, SUBJECT_FILE, inputs, (".toml",))
    recording = read_recording(source)
    progress, task = progress_bar(STAGES[0], len(STAGES))
    with progress:

        def on_stage(stage: str) -> None:
            progress.update(task, description=stage, completed=STAGES.index(stage))

        found = found_body(recording, settings, frames=min(frames, len(recording)), on_stage=on_stage)
        progress.update(task, completed=len(STAGES))
    write_subject(output, found.skeleton, found.body)
    Console().print(length_table(found))
    say(_summary(output, found))


def length_table(found: CalibratedBody) -> Table:
    """Table of the lengths with their uncertainty and the evidence for them."""
    table = Table(title=f"lengths from {found.frames} frames")
    for column in ("length", "mm", "± mm", "guessed"):
        table.add_column(column, justify="right" if "mm" in column else "left")
    for name, each in found.lengths.items():
        note = f"{' and '.join(each.still)} hardly turned" if each.still else ""
        table.add_row(name, f"{1e3 * each.length:.0f}", f"{1e3 * each.deviation:.0f}", note)
    return table


def _summary(output: Path, found: CalibratedBody) -> str:
    guessed = [name for name, each in found.lengths.items() if each.still]
    kept = f"{len(found.lengths)} lengths of a subject of {found.skeleton.stature:.2f} m from {found.frames} frames"
    doubt = f"; guessed: {', '.join(guessed)}, film these joints turning" if guessed else ""
    return f"{output}: {kept}{doubt}"
