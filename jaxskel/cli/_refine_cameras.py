"""`jaxskel refine-cameras`: refines extrinsics until the silhouettes agree."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from ..camera_calibration.from_silhouettes import FRAMES, RefinedCameras
from ..camera_calibration.from_silhouettes import refine_cameras as refined
from ..cameras import Cameras
from ..io.calibrations import write_calibration, write_pose2sim_calibration
from ..io.recordings import read_recording
from ._outputs import chosen_file, files_of
from ._ranges import check_number
from ._run import Recorded
from ._say import cell, say


def refine_cameras(
    source: Recorded,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="Calibration to write: .toml, as Pose2Sim reads it, or .npz.",
            show_default="refined.toml",
        ),
    ] = None,
    frames: Annotated[int, typer.Option(min=1, help="Frames to use, spread evenly.")] = FRAMES,
    rotation: Annotated[float, typer.Option(help="How far off a camera may point, standard deviation (°).")] = 1.0,
    shift: Annotated[float, typer.Option(help="How far off a camera may stand, standard deviation (m).")] = 0.02,
) -> None:
    """Turn and move cameras until the silhouettes agree; write the calibration, under the names of the views."""
    check_number("--rotation", rotation, 1e-3, 90, "degrees")
    check_number("--shift", shift, 1e-5, 10, "metres")
    output = chosen_file(output, "refined.toml", files_of(source), (".toml", ".npz"))
    given = read_recording(source)
    if output.suffix == ".toml" and given.up != "+Z":
        raise ValueError(f"{output}: such files have no up axis, and this recording's is {given.up}; write a .npz")
    with Console(stderr=True).status("refining"):
        found = refined(given, min(frames, len(given)), float(np.radians(rotation)), shift)
    if len(found.frames) == 0:
        raise ValueError(f"{source}: no frame shows the person in three views or more, so cameras cannot be refined")
    _write(output, found.cameras, given.up)
    Console().print(refinement_table(found))
    doubt = "" if found.converged else ", not converged: run again on the result"
    say(
        f"{output}: {len(found.cameras)} cameras from {len(found.frames)} frames, outlines miss by "
        f"{np.nanmean(found.before):.2f} px before and {np.nanmean(found.after):.2f} px after{doubt}"
    )


def refinement_table(found: RefinedCameras) -> Table:
    """Table of how far each camera rotated and moved."""
    table = Table(title="cameras refined by silhouettes")
    for column in ("camera", "turned °", "moved mm", ""):
        table.add_column(column, justify="right" if column and column != "camera" else "left")
    for c, name in enumerate(found.cameras.names):
        turned, moved = np.degrees(np.linalg.norm(found.rotation[c])), 1e3 * np.linalg.norm(found.shift[c])
        note = "hardly determined" if found.hardly_seen[c] else ""
        table.add_row(cell(name), f"{turned:.2f}", f"{moved:.1f}", note)
    return table


def _write(output: Path, cameras: Cameras, up: str) -> None:
    if output.suffix == ".toml":
        write_pose2sim_calibration(output, cameras)
    else:
        write_calibration(output, cameras, up)
