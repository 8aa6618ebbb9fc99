"""`jaxskel evaluate`: scores poses against ground truth."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from .._runtime.atomic_files import written_whole
from ..io.poses import read_poses, read_truth
from ..poses import Score, score_poses, score_table
from ..recording import rows_by_index
from ._outputs import check_output
from ._poseless import end_without_pose
from ._say import say

SCORE_FILES = ("score.json", "score.png")


def evaluate(
    poses: Annotated[Path, typer.Argument(help="poses.npz as written by `jaxskel run`.")],
    truth: Annotated[Path, typer.Argument(help="Sequence file or poses.npz with the true joints.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Folder for score.json and score.png.")] = None,
) -> None:
    """Score poses as the paper's Table 1 and Figure 3 do."""
    if output is not None:
        check_output(output, SCORE_FILES, [poses, truth])
    estimated = read_poses(poses)
    true, up, index = read_truth(truth)
    if up != estimated.up:
        raise ValueError(f"{truth}: up is {up} but {poses} has {estimated.up}; give both in the same world")
    rows = rows_by_index(str(truth), index, estimated)
    try:
        result = score_poses(estimated, true.joints[rows], true.template)
    except ValueError as error:
        raise ValueError(f"{truth}: {error}") from None
    Console().print(score_table({poses.parent.name or poses.stem: result}))
    if output is not None:
        say(f"{write_score(output, result)}: {len(result)} frames scored")
    end_without_pose(poses, estimated)


def write_score(folder: Path, result: Score) -> Path:
    """Write score.json and score.png; return the path of the first."""
    figures, picture = (folder / name for name in SCORE_FILES)
    with written_whole(figures) as file:
        file.write((json.dumps(result.to_dict(), indent=1) + "\n").encode())
    from ..visualization.plots import plot_score

    plot_score(result, picture)
    return figures
