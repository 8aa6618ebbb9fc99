"""`jaxskel evaluate`: scores poses against ground truth."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from .._runtime.atomic_files import written_whole
from ..body import KeypointSet
from ..io.poses import Markers, read_people_poses, read_people_truth, read_trc, turn_up
from ..poses import PeopleScore, Poses, Score, join_scores, score_markers, score_people, score_poses, score_table
from ..recording import rows_by_index
from ._keypoints import KEYPOINT_SETS, named_keypoints
from ._outputs import check_output
from ._poseless import end_without_pose
from ._say import say

SCORE_FILES = ("score.json", "score.png")


def evaluate(
    poses: Annotated[Path, typer.Argument(help="poses.npz as written by `jaxskel run`.")],
    truth: Annotated[
        Path, typer.Argument(help="Sequence file or poses.npz with the true joints, or a .trc with true markers.")
    ],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Folder for score.json and score.png.")] = None,
    keypoints: Annotated[
        str | None,
        typer.Option(
            metavar="SET",
            help=f"What the markers of a .trc are, if they are not named as the joints: {', '.join(KEYPOINT_SETS)}.",
        ),
    ] = None,
    up: Annotated[str, typer.Option(help="World axis that points up in a .trc.")] = "+Y",
) -> None:
    """Score poses as the paper's Table 1 and Figure 3 do."""
    if output is not None:
        check_output(output, SCORE_FILES, [poses, truth])
    people = read_people_poses(poses)
    if truth.suffix.lower() == ".trc":
        keypoint_set = None if keypoints is None else named_keypoints(keypoints)
        result, figures = _against_markers(poses, people, truth, read_trc(truth, up=up), keypoint_set), None
    elif keypoints is not None or up != "+Y":
        raise ValueError(f"{truth}: --keypoints and --up are for a .trc; leave them out")
    else:
        result, figures = _against_joints(poses, people, truth)
    if output is not None:
        say(f"{write_score(output, result, figures)}: {len(result)} frames scored")
    end_without_pose(poses, *people.values())


def _against_markers(
    poses: Path, people: dict[str, Poses], truth: Path, markers: Markers, keypoint_set: KeypointSet | None
) -> Score:
    """Score one person against a file of markers, and print the table."""
    if len(people) > 1:
        raise ValueError(f"{truth}: has one person, {poses} has {len(people)}; export and score each by themselves")
    found = next(iter(people.values()))
    # Frames of this package count from 0, those of Pose2Sim and OpenSim from 1.
    first = int(markers.frame_index[0] == 1 and found.frame_index[0] != 1)
    rows = rows_by_index(str(truth), markers.frame_index - first, found)
    positions = markers.positions[rows] @ turn_up(markers.up, found.up).T
    try:
        result = score_markers(found, positions, markers.names, keypoint_set)
    except ValueError as error:
        raise ValueError(f"{truth}: {error}") from None
    Console().print(score_table({poses.parent.name or poses.stem: result}))
    if first:
        say(f"{truth}: its frame 1 is taken for frame 0 of {poses}")
    return result


def _against_joints(poses: Path, people: dict[str, Poses], truth: Path) -> tuple[Score, dict[str, Any]]:
    """Score people against true joints, and print the table; also the figures for JSON."""
    truths = read_people_truth(truth)
    rows = {}
    for name, (_, up, index) in truths.items():
        for each in people.values():
            if up != each.up:
                raise ValueError(f"{truth}: up is {up} but {poses} has {each.up}; give both in the same world")
            rows[name] = rows_by_index(str(truth), index, each)
    try:
        if len(people) == len(truths) == 1:
            (true, _, _), estimated = truths.popitem()[1], next(iter(people.values()))
            result = score_poses(estimated, true.joints[next(iter(rows.values()))], true.template)
            Console().print(score_table({poses.parent.name or poses.stem: result}))
            figures = result.to_dict()
        else:
            template = next(iter(truths.values()))[0].template
            every = score_people(people, {name: true[0].joints[rows[name]] for name, true in truths.items()}, template)
            result, figures = join_scores(every.scores.values()), _figures(every)
            Console().print(score_table({_both(name, every.found_as[name]): one for name, one in every.scores.items()}))
            say(
                f"{every.exchanged} identities exchanged, {every.missed} people missed and {every.false} false of "
                f"{every.total} in all frames: MOTA {100 * every.accuracy:.1f} %"
            )
    except ValueError as error:
        raise ValueError(f"{truth}: {error}") from None
    return result, figures


def _both(true: str, found: str | None) -> str:
    """Name of a true person, with that of the poses that are theirs."""
    return true if found == true else f"{true} (no poses)" if found is None else f"{true} ({found})"


def _figures(every: PeopleScore) -> dict[str, Any]:
    """The figures of several people, as plain numbers for JSON."""
    return {
        "people": {
            name: {"found_as": every.found_as[name], **one.to_dict()} for name, one in every.scores.items()
        },
        "identities_exchanged": every.exchanged, "missed": every.missed, "false": every.false, "total": every.total,
        "mota": every.accuracy,
    }  # fmt: skip


def write_score(folder: Path, result: Score, figures_of_all: dict[str, Any] | None = None) -> Path:
    """Write score.json, of `figures_of_all` if they are others than the score's, and score.png; return the first."""
    figures, picture = (folder / name for name in SCORE_FILES)
    with written_whole(figures) as file:
        file.write((json.dumps(figures_of_all or result.to_dict(), indent=1) + "\n").encode())
    from ..visualization.plots import plot_score

    plot_score(result, picture)
    return figures
