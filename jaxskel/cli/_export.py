"""`jaxskel export`: writes poses in the formats of other programs, and what a killed session left as `poses.npz`.

Of several people, each has a file of their own.
"""

from pathlib import Path
from typing import Annotated

import typer

from ..body import HUMAN_15, KeypointSet
from ..io.poses import (
    read_people_poses,
    with_up,
    write_angles,
    write_archive,
    write_bvh,
    write_c3d,
    write_keypoint_table,
    write_mot,
    write_table,
    write_trc,
    write_trc_deviations,
)
from ..poses import Poses
from ..recording import UP_AXES
from ._keypoints import KEYPOINT_SETS, named_keypoints
from ._outputs import check_output_file
from ._poseless import end_without_pose
from ._say import say

# Programs that open each kind of file, for error messages.
_KINDS = {
    ".trc": "OpenSim, Pose2Sim",
    ".mot": "OpenSim",
    ".c3d": "motion capture laboratories",
    ".bvh": "Blender and other animation programs",
    ".csv": "spreadsheets",
    ".npz": "jaxskel",
}
# Names with this end are written with the standard deviations of the coordinates.
_DEVIATIONS = ".sigma.trc"
# Names with this end are tables of joint angles.
_ANGLES = "angles.csv"


def export(
    poses: Annotated[
        Path, typer.Argument(help="poses.npz as written by `jaxskel run`, or poses.live of a session that was killed.")
    ],
    outputs: Annotated[
        list[Path],
        typer.Argument(
            metavar="OUTPUT...",
            help="Files to write; the end of the name decides: .trc, .sigma.trc, .mot, .c3d, .bvh, .csv, angles.csv or "
            ".npz.",
        ),
    ],
    up: Annotated[
        str | None,
        typer.Option(
            help="World axis that points up. Default: +Y in .trc and .bvh, +Z in .c3d, else that of the poses. A .mot "
            "has +Y always."
        ),
    ] = None,
    millimetres: Annotated[
        bool, typer.Option("--millimetres", help="Millimetres instead of metres in a .trc, which names its unit.")
    ] = False,
    keypoints: Annotated[
        str | None,
        typer.Option(
            metavar="SET",
            help=f"Keypoints instead of joints and tips, in a .trc, .c3d or .csv: {', '.join(KEYPOINT_SETS)}.",
        ),
    ] = None,
) -> None:
    """Write poses as TRC, MOT, C3D, BVH, CSV or NPZ, for other programs to open."""
    for output in outputs:
        if output.suffix.lower() not in _KINDS:
            known = ", ".join(f"{suffix} ({opens})" for suffix, opens in _KINDS.items())
            raise ValueError(f"{output}: unknown kind of file; give a name that ends in one of {known}")
    if up is not None and up not in UP_AXES:
        raise ValueError(f"--up {up}: give one of {', '.join(UP_AXES)}")
    if millimetres and all(output.suffix.lower() != ".trc" for output in outputs):
        raise ValueError("--millimetres: only a .trc may hold metres or millimetres; leave it out")
    if up not in (None, "+Y") and any(output.suffix.lower() == ".mot" for output in outputs):
        raise ValueError(f"--up {up}: OpenSim's motions have +Y up; write the .mot by itself, without --up")
    keypoint_set = None if keypoints is None else _keypoint_set(keypoints, outputs)
    found = read_people_poses(poses)
    files = {name: outputs if len(found) == 1 else [_of_person(output, name) for output in outputs] for name in found}
    for each in files.values():
        for output in each:
            check_output_file(output, [poses])
    for name, each in found.items():
        _check_exportable(poses, files[name], each, keypoint_set)
    for name, each in found.items():
        for output in files[name]:
            told = _write(output, each, up, millimetres, keypoint_set)
            say(f"{output}: {len(each)} frames at {each.fps:g} fps, {told}")
    end_without_pose(poses, *found.values())


def _of_person(output: Path, name: str) -> Path:
    """The file of one of several people: anna's trial.trc is trial_anna.trc."""
    for end in (_DEVIATIONS, f".{_ANGLES}", f"_{_ANGLES}"):
        if output.name.lower().endswith(end):
            return output.with_name(f"{output.name[: -len(end)]}_{name}{output.name[-len(end) :]}")
    if output.name.lower() == _ANGLES:
        return output.with_name(f"{name}_{output.name}")
    return output.with_name(f"{output.stem}_{name}{output.suffix}")


def _check_exportable(poses: Path, outputs: list[Path], found: Poses, keypoint_set: KeypointSet | None) -> None:
    """Refuse files for which the poses of a person lack something."""
    motions = [output for output in outputs if output.suffix.lower() in (".bvh", ".mot")]
    if motions and not found.has_pose.any():
        raise ValueError(f"{motions[0]}: no frame has a pose: there is no motion to write")
    angles = [output for output in outputs if _is_angles(output) or output.suffix.lower() == ".mot"]
    if angles and found.template != HUMAN_15 and not found.template.hinges:
        raise ValueError(f"{angles[0]}: the skeleton of {poses} has no hinges, so there are no angles; leave it out")
    if keypoint_set is not None and found.template != HUMAN_15:
        raise ValueError(
            f"--keypoints {keypoint_set.name}: is of a human, and {poses} of {found.template.name}; leave it out"
        )
    if (motions or angles or keypoint_set is not None) and found.rotations is None:
        raise ValueError(f"{poses}: holds no rotations, because an older version wrote it; reconstruct again")
    deviations = [output for output in outputs if output.name.lower().endswith(_DEVIATIONS)]
    if deviations and found.covariance is None:
        raise ValueError(f"{poses}: has no covariances for {deviations[0]}; run again, with the default preset")


def _keypoint_set(name: str, outputs: list[Path]) -> KeypointSet:
    found = named_keypoints(name)
    for output in outputs:
        other = output.name.lower().endswith((_DEVIATIONS, _ANGLES))
        if other or output.suffix.lower() not in (".trc", ".c3d", ".csv"):
            raise ValueError(f"--keypoints {name}: {output} cannot hold them; write it by itself, without --keypoints")
    return found


def _is_angles(output: Path) -> bool:
    return output.name.lower().endswith(_ANGLES)


def _write(output: Path, poses: Poses, up: str | None, millimetres: bool, keypoint_set: KeypointSet | None) -> str:
    """Write one file; return its unit, its up axis, and how frames without a pose are written."""
    gaps = int((~poses.has_pose).sum())
    kind = output.suffix.lower()
    if kind == ".trc":
        up = up or "+Y"
        deviations = output.name.lower().endswith(_DEVIATIONS)
        if deviations:
            write_trc_deviations(output, poses, up=up, millimetres=millimetres)
        else:
            write_trc(output, poses, up=up, millimetres=millimetres, keypoint_set=keypoint_set)
        what = "standard deviations, " if deviations else ""
        return f"{what}{'mm' if millimetres else 'm'}, {up} up; {gaps} without a pose: empty cells"
    if kind == ".mot":
        write_mot(output, poses)
        return f"degrees and m, +Y up; {gaps} without a pose: left out"
    if _is_angles(output):
        write_angles(output, poses)
        return f"joint angles in degrees; {gaps} without a pose: empty cells"
    if kind == ".c3d":
        up = up or "+Z"
        try:
            write_c3d(output, poses, up=up, keypoint_set=keypoint_set)
        except ImportError as error:
            raise ValueError(f"{output}: {error}") from None
        return f"mm, {up} up; {gaps} without a pose: residual -1"
    if kind == ".bvh":
        up = up or "+Y"
        made = write_bvh(output, poses, up=up)
        away = f"joints within {1000 * made.deviation:.2f} mm of the poses (farthest: {made.farthest})"
        return f"cm, {up} up; {made.held} without a pose: another held; {away}"
    up = up or poses.up
    if kind == ".npz":
        write_archive(output, with_up(poses, up))
        return f"m, {up} up; {gaps} without a pose: NaN"
    if keypoint_set is None:
        write_table(output, with_up(poses, up))
    else:
        write_keypoint_table(output, with_up(poses, up), keypoint_set)
    return f"m, {up} up; {gaps} without a pose: empty cells"
