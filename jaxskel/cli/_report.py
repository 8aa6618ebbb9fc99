"""`jaxskel report`: a recording and its poses as one HTML page."""

from pathlib import Path
from typing import Annotated

import typer

from ..io import read_poses, read_recording
from ..report import LIMIT, write_report
from ._progress import progress_bar
from ._run import Recorded, check_output_file


def report(
    source: Recorded,
    poses: Annotated[Path, typer.Argument(help="poses.npz as written by `jaxskel run`.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="HTML file to write.")] = Path("report.html"),
    limit: Annotated[float, typer.Option(min=0, help="Greatest size of the page (MB).")] = LIMIT / 1e6,
) -> None:
    """Write a page that plays the poses in 3D and over the silhouettes; it opens offline in any browser."""
    check_output_file(output)
    recording, found = read_recording(source), read_poses(poses)
    progress, task = progress_bar("drawing outlines", len(found))
    with progress:
        size = write_report(
            output, recording, found, round(1e6 * limit), lambda done: progress.update(task, completed=done)
        )
    print(f"{output}: {len(found)} frames, {len(recording.cameras)} views, {size / 1e6:.1f} MB")
