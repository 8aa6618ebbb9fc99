"""`jaxskel report`: writes a recording and its poses as one HTML page."""

from pathlib import Path
from typing import Annotated

import typer

from ..io.poses import read_people_poses
from ..visualization.report import LIMIT, write_report
from ._everybody import one_or_all, read_room
from ._outputs import chosen_file, files_of
from ._poseless import end_without_pose
from ._progress import progress_bar
from ._ranges import check_number
from ._run import Recorded
from ._say import say

_LARGEST = 2000  # MB; no browser opens a larger page


def report(
    source: Recorded,
    poses: Annotated[Path, typer.Argument(help="poses.npz as written by `jaxskel run`.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="HTML file to write.", show_default="report.html")
    ] = None,
    limit: Annotated[float, typer.Option(help="Greatest size of the page (MB).")] = LIMIT / 1e6,
) -> None:
    """Write a page that plays the poses in 3D and over the silhouettes; it opens offline in any browser."""
    check_number("--limit", limit, 0, _LARGEST, "megabytes")
    output = chosen_file(output, "report.html", [*files_of(source), poses])
    recording, people = read_room(source), read_people_poses(poses)
    frames = len(next(iter(people.values())))
    progress, task = progress_bar("drawing outlines", frames)
    with progress:
        size = write_report(
            output, recording, one_or_all(people), round(1e6 * limit),
            lambda done: progress.update(task, completed=done),
        )  # fmt: skip
    several = f"{len(people)} people, " if len(people) > 1 else ""
    say(f"{output}: {several}{frames} frames, {len(recording.cameras)} views, {size / 1e6:.1f} MB")
    end_without_pose(poses, *people.values())
