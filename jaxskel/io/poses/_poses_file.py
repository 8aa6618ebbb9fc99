"""Poses on disk: `poses.npz` for programs, `poses.csv` for spreadsheets; and the ground truth to score them against."""

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np

from ..._runtime.atomic_files import written_whole
from ...body import JOINT_NAMES, JOINT_PARENTS, TIP_NAMES
from ...poses import STATUS_NAMES, WITH_POSE, Poses
from ...recording import Truth
from ..calibrations import up_axis
from ..files import fault, numbers, read_arrays
from ..recordings import check_names, frame_numbers, frame_rate, truth


def write_poses(folder: str | Path, poses: Poses) -> tuple[Path, Path]:
    """Write `poses.npz` and `poses.csv` into a folder, which is created if missing.

    Lengths are metres in the world of the recording. The table has a row for each frame, with empty cells if there is
    no pose; its time starts at the first row.

    Returns:
        The two paths.
    """
    archive, table = Path(folder) / "poses.npz", Path(folder) / "poses.csv"
    arrays: dict[str, Any] = {
        "joints": np.asarray(poses.joints, np.float32), "tips": np.asarray(poses.tips, np.float32),
        "confidence": np.asarray(poses.confidence, np.float32),
        "side_confidence": np.asarray(poses.side_confidence, np.float32),
        "status": np.asarray(poses.status, np.int8), "status_names": STATUS_NAMES,
        "joint_names": JOINT_NAMES, "joint_parents": JOINT_PARENTS, "tip_names": TIP_NAMES,
        "fps": poses.fps, "up": poses.up, "frame_index": poses.frame_index,
    }  # fmt: skip
    with written_whole(archive) as file:
        np.savez_compressed(file, **arrays)
    return archive, write_table(table, poses)


def write_table(path: str | Path, poses: Poses) -> Path:
    """Write the `poses.csv` of [`write_poses`][] alone, under any name; return its path."""
    path = Path(path)
    with written_whole(path) as file, io.TextIOWrapper(file, "utf-8", newline="") as text:
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(
            ["frame_index", "time_s", "status"]
            + [f"{joint}_{axis}" for joint in JOINT_NAMES for axis in "xyz"]
            + [f"{joint}_confidence" for joint in JOINT_NAMES]
        )
        for i, has_pose in enumerate(poses.has_pose):
            row = [str(poses.frame_index[i]), f"{i / poses.fps:.6f}", STATUS_NAMES[poses.status[i]]]
            if has_pose:
                row += [f"{x:.6f}" for x in poses.joints[i].ravel()] + [f"{c:.4f}" for c in poses.confidence[i]]
            else:
                row += [""] * (4 * len(JOINT_NAMES))
            rows.writerow(row)
    return path


def read_poses(path: str | Path) -> Poses:
    """Read a `poses.npz` that [`write_poses`][] wrote.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    path = Path(path)
    arrays = read_arrays(
        path,
        required=("joints", "tips", "confidence", "side_confidence", "status", "fps", "up", "frame_index"),
        optional=("joint_names", "tip_names", "status_names"),
    )
    for key, names in (
        ("joint_names", JOINT_NAMES),
        ("tip_names", TIP_NAMES),
        ("status_names", STATUS_NAMES),
    ):
        check_names(path, arrays, key, names)
    joints = numbers(path, arrays, "joints", (None, 15, 3), nan=True)
    n = len(joints)
    status = arrays["status"]
    if (
        status.shape != (n,)
        or status.dtype.kind not in "iu"
        or not ((status >= 0) & (status < len(STATUS_NAMES))).all()
    ):
        raise fault(path, "status", f"give {n} whole numbers, each the index of one of {', '.join(STATUS_NAMES)}")
    tips = numbers(path, arrays, "tips", (n, 5, 3), nan=True)
    has_pose = np.isin(status, WITH_POSE)
    for key, points in (("joints", joints), ("tips", tips)):
        wrong = np.where(has_pose, np.isnan(points).any(axis=(1, 2)), ~np.isnan(points).all(axis=(1, 2)))
        if wrong.any():
            frame = int(np.argmax(wrong))
            raise fault(
                path,
                key,
                f"status of frame {frame} is {STATUS_NAMES[status[frame]]}, but its points are "
                f"{'not all numbers' if has_pose[frame] else 'not all NaN'}; write the file again",
            )
    return Poses(
        joints=joints.astype(np.float32),
        tips=tips.astype(np.float32),
        confidence=_shares(path, arrays, "confidence", (n, 15)),
        side_confidence=_shares(path, arrays, "side_confidence", (n,)),
        status=status.astype(np.int64),
        fps=frame_rate(path, arrays),
        up=up_axis(path, arrays),
        frame_index=frame_numbers(path, arrays, n),
    )


def read_truth(path: str | Path) -> tuple[Truth, str, np.ndarray]:
    """Read what poses can be scored against: the ground truth of a sequence file, or the poses of a `poses.npz`.

    Returns:
        The joints (world, m, NaN where unknown), the world's up axis, and the number of each frame.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    path = Path(path)
    arrays = read_arrays(path, ("joints",), ("tips", "up", "frame_index", "joint_names", "tip_names"))
    check_names(path, arrays, "joint_names", JOINT_NAMES)
    check_names(path, arrays, "tip_names", TIP_NAMES)
    found = truth(path, arrays, None)
    assert found is not None  # `joints` is required above
    return found, up_axis(path, arrays), frame_numbers(path, arrays, len(found.joints))


def _shares(path: Path, arrays: dict[str, np.ndarray], key: str, shape: tuple[int, ...]) -> np.ndarray:
    shares = numbers(path, arrays, key, shape)
    if ((shares < 0) | (shares > 1)).any():
        where = tuple(int(i) for i in np.argwhere((shares < 0) | (shares > 1))[0])
        raise fault(path, key, f"holds {shares[where]} at index {where}; a confidence lies in 0..1")
    return shares.astype(np.float32)
