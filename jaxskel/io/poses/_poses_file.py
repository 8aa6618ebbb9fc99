"""Poses on disk: `poses.npz` for programs, `poses.csv` for spreadsheets; and the ground truth to score them against."""

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ..._runtime.atomic_files import written_whole
from ...body import KeypointSet, Skeleton, SkeletonTemplate
from ...poses import STATUS_NAMES, WITH_POSE, Poses
from ...recording import Truth
from ..calibrations import up_axis
from ..files import fault, numbers, read_arrays, texts
from ..recordings import (
    TEMPLATE_KEYS,
    check_names,
    frame_numbers,
    frame_rate,
    skeleton_of,
    template_arrays,
    template_of,
    truth,
)
from ._journal import JOURNAL_FILE, journal_arrays
from ._markers import to_markers

PEOPLE_KEY = "people"
"""Key of the names of several people; other arrays then have an axis of people first, see `_people_file.py`."""
# What an older version did not write.
_ROTATIONS = ("rotations", "rest_joints", "rest_tips")
_UNCERTAINTY = ("sigma", "stature_sigma")
# Poses compress to a half; an archive that is made to fill the memory, to a thousandth.
_COMPRESSED = 20
# A matrix whose product with its transpose is off the identity by more is no rotation that was rounded.
_NO_ROTATION = 1e-3


def write_poses(folder: str | Path, poses: Poses) -> tuple[Path, Path]:
    """Write `poses.npz` and `poses.csv` into a folder, which is created if missing.

    Lengths are metres in the world of the recording. The table has a row for each frame, with empty cells if there is
    no pose; its time starts at the first row.

    Returns:
        The two paths.
    """
    return write_archive(Path(folder) / "poses.npz", poses), write_table(Path(folder) / "poses.csv", poses)


def write_archive(path: str | Path, poses: Poses) -> Path:
    """Write the `poses.npz` of [`write_poses`][] alone, under any name; return its path."""
    path = Path(path)
    with written_whole(path) as file:
        np.savez_compressed(file, **arrays_of(poses))
    return path


def arrays_of(poses: Poses) -> dict[str, Any]:
    """The arrays of a `poses.npz`, by key."""
    template = poses.template
    arrays: dict[str, Any] = {
        "joints": np.asarray(poses.joints, np.float32), "tips": np.asarray(poses.tips, np.float32),
        "confidence": np.asarray(poses.confidence, np.float32),
        "side_confidence": np.asarray(poses.side_confidence, np.float32),
        "status": np.asarray(poses.status, np.int8), "status_names": STATUS_NAMES,
        "joint_names": template.joint_names, "joint_parents": template.joint_parents, "tip_names": template.tip_names,
        **template_arrays(template), "fps": poses.fps, "up": poses.up, "frame_index": poses.frame_index,
    }  # fmt: skip
    if poses.rotations is not None and poses.skeleton is not None:
        arrays |= {
            "rotations": np.asarray(poses.rotations, np.float32), "segment_names": template.segment_names,
            "rest_joints": np.asarray(poses.skeleton.rest_joints), "rest_tips": np.asarray(poses.skeleton.rest_tips),
        }  # fmt: skip
    if poses.covariance is not None:
        arrays["sigma"] = np.asarray(poses.covariance, np.float32)
    if poses.stature_deviation is not None:
        arrays["stature_sigma"] = poses.stature_deviation
    return arrays


def write_table(path: str | Path, poses: Poses) -> Path:
    """Write the `poses.csv` of [`write_poses`][] alone, under any name; return its path."""
    path, joints = Path(path), poses.template.joint_names
    with written_whole(path) as file, io.TextIOWrapper(file, "utf-8", newline="") as text:
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(
            ["frame_index", "time_s", "status"]
            + [f"{joint}_{axis}" for joint in joints for axis in "xyz"]
            + [f"{joint}_confidence" for joint in joints]
            + [f"{joint}_sigma_mm" for joint in joints]
        )
        deviations = poses.deviations
        for i, has_pose in enumerate(poses.has_pose):
            row = [str(poses.frame_index[i]), f"{i / poses.fps:.6f}", STATUS_NAMES[poses.status[i]]]
            if has_pose:
                row += [f"{x:.6f}" for x in poses.joints[i].ravel()] + [f"{c:.4f}" for c in poses.confidence[i]]
                row += [""] * len(joints) if deviations is None else [f"{1e3 * s:.1f}" for s in deviations[i]]
            else:
                row += [""] * (5 * len(joints))
            rows.writerow(row)
    return path


def write_keypoint_table(path: str | Path, poses: Poses, keypoint_set: KeypointSet) -> Path:
    """Write keypoints as a table like `poses.csv` (m), but for those that the skeleton has no point for.

    Returns:
        The path.

    Raises:
        ValueError: There are no frames, or the poses have no keypoints.
    """
    path, markers = Path(path), to_markers(poses, keypoint_set)
    with written_whole(path) as file, io.TextIOWrapper(file, "utf-8", newline="") as text:
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(
            ["frame_index", "time_s", "status"] + [f"{name}_{axis}" for name in markers.names for axis in "xyz"]
        )
        for i, points in enumerate(markers.positions):
            row = [str(poses.frame_index[i]), f"{i / poses.fps:.6f}", STATUS_NAMES[poses.status[i]]]
            rows.writerow(row + [f"{x:.6f}" if poses.has_pose[i] else "" for x in points.ravel()])
    return path


def read_poses(path: str | Path) -> Poses:
    """Read a `poses.npz` that [`write_poses`][] wrote. If an older version did, rotations and skeleton are None.

    A `poses.live`, which `jaxskel live` leaves where it is killed, is read too.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    path = Path(path)
    arrays = journal_arrays(path) if path.suffix == Path(JOURNAL_FILE).suffix else archived_poses(path)
    if PEOPLE_KEY in arrays:
        names = ", ".join(texts(path, arrays, PEOPLE_KEY))
        raise fault(path, PEOPLE_KEY, f"holds several people: {names}; read them with read_people_poses")
    return poses_of(path, arrays)


def poses_of(path: Path, arrays: dict[str, np.ndarray]) -> Poses:
    """Check the arrays of a `poses.npz`, and make `Poses` of them.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    template = template_of(path, arrays)
    check_names(path, arrays, "status_names", STATUS_NAMES)
    check_names(path, arrays, "segment_names", template.segment_names)
    count = len(template.joint_names)
    joints = numbers(path, arrays, "joints", (None, count, 3), nan=True)
    n = len(joints)
    status = arrays["status"]
    if (
        status.shape != (n,)
        or status.dtype.kind not in "iu"
        or not ((status >= 0) & (status < len(STATUS_NAMES))).all()
    ):
        raise fault(path, "status", f"give {n} whole numbers, each the index of one of {', '.join(STATUS_NAMES)}")
    tips = numbers(path, arrays, "tips", (n, len(template.tip_names), 3), nan=True)
    for key, points in (("joints", joints), ("tips", tips)):
        _check_gaps(path, key, points, status, "points")
    rotations, skeleton = _rotations(path, arrays, status, template)
    return Poses(
        joints=joints.astype(np.float32),
        tips=tips.astype(np.float32),
        rotations=rotations,
        skeleton=skeleton,
        confidence=_shares(path, arrays, "confidence", (n, count)),
        side_confidence=_shares(path, arrays, "side_confidence", (n,)),
        status=status.astype(np.int64),
        fps=frame_rate(path, arrays),
        up=up_axis(path, arrays),
        frame_index=frame_numbers(path, arrays, n),
        covariance=_covariance(path, arrays, status, template),
        stature_deviation=_stature_deviation(path, arrays),
        template=template,
    )


def archived_poses(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a `poses.npz`, of one person or several."""
    return read_arrays(
        path,
        required=("joints", "tips", "confidence", "side_confidence", "status", "fps", "up", "frame_index"),
        optional=(*TEMPLATE_KEYS, "status_names", "segment_names", *_ROTATIONS, *_UNCERTAINTY, PEOPLE_KEY),
        most=max(2**28, _COMPRESSED * path.stat().st_size) if path.is_file() else 2**28,
    )


def read_truth(path: str | Path, of: str = "") -> tuple[Truth, str, Int[np.ndarray, " frames"]]:
    """Read what poses can be scored against: the ground truth of a sequence file, or the poses of a `poses.npz`.

    Args:
        path: The file.
        of: End of the keys of one of several people in a sequence file.

    Returns:
        The joints (world, m, NaN where unknown), the world's up axis, and the number of each frame.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    path = Path(path)
    arrays = read_arrays(path, (f"joints{of}",), (f"tips{of}", "up", "frame_index", *TEMPLATE_KEYS))
    arrays |= {key: arrays[key + of] for key in ("joints", "tips") if key + of in arrays}
    found = truth(path, arrays, None, template_of(path, arrays))
    assert found is not None  # `joints` is required above
    return found, up_axis(path, arrays), frame_numbers(path, arrays, len(found.joints))


def _rotations(
    path: Path, arrays: dict[str, np.ndarray], status: np.ndarray, template: SkeletonTemplate
) -> tuple[Float[np.ndarray, "frames segments 3 3"] | None, Skeleton | None]:
    """Rotations of the segments and the skeleton that they are of (m), where the file has them."""
    missing = [key for key in _ROTATIONS if key not in arrays]
    if len(missing) == len(_ROTATIONS):
        return None, None
    if missing:
        raise fault(path, missing[0], f"is missing; give all of {', '.join(_ROTATIONS)}, or none")
    rotations = numbers(path, arrays, "rotations", (len(status), len(template.segment_names), 3, 3), nan=True)
    _check_gaps(path, "rotations", rotations, status, "rotations")
    known = np.isin(status, WITH_POSE)
    found = rotations[known]
    off = np.abs(found @ found.swapaxes(-1, -2) - np.eye(3)).max((-2, -1)) > _NO_ROTATION
    wrong = off | (np.linalg.det(found) < 0)
    if wrong.any():
        row, segment = (int(i) for i in np.argwhere(wrong)[0])
        frame = int(np.flatnonzero(known)[row])
        raise fault(
            path, "rotations", f"frame {frame}, {template.segment_names[segment]}: no rotation; write the file again"
        )
    return rotations.astype(np.float32), skeleton_of(path, arrays, template)


def _covariance(
    path: Path, arrays: dict[str, np.ndarray], status: np.ndarray, template: SkeletonTemplate
) -> Float[np.ndarray, "frames joints 3 3"] | None:
    """Covariances of the joints (m^2), where the file has them."""
    if "sigma" not in arrays:
        return None
    covariance = numbers(path, arrays, "sigma", (len(status), len(template.joint_names), 3, 3), nan=True)
    _check_gaps(path, "sigma", covariance, status, "covariances")
    known = np.flatnonzero(np.isin(status, WITH_POSE))
    wrong = np.linalg.eigvalsh(covariance[known]).min(-1) <= 0
    if wrong.any():
        row, joint = (int(i) for i in np.argwhere(wrong)[0])
        raise fault(
            path, "sigma", f"frame {known[row]}, {template.joint_names[joint]}: no covariance; write the file again"
        )
    return covariance.astype(np.float32)


def _stature_deviation(path: Path, arrays: dict[str, np.ndarray]) -> float | None:
    """Standard deviation of the stature (m), where the file has it."""
    if "stature_sigma" not in arrays:
        return None
    found = float(numbers(path, arrays, "stature_sigma", ()))
    if found < 0:
        raise fault(path, "stature_sigma", f"is {found:g}; a standard deviation is not below zero")
    return found


def _check_gaps(path: Path, key: str, values: np.ndarray, status: np.ndarray, what: str) -> None:
    """Refuse values that are missing in a frame with a pose, or there in a frame without one."""
    has_pose, missing = np.isin(status, WITH_POSE), np.isnan(values).reshape(len(values), -1)
    wrong = np.where(has_pose, missing.any(1), ~missing.all(1))
    if wrong.any():
        frame = int(np.argmax(wrong))
        raise fault(
            path,
            key,
            f"status of frame {frame} is {STATUS_NAMES[status[frame]]}, but its {what} are "
            f"{'not all numbers' if has_pose[frame] else 'not all NaN'}; write the file again",
        )


def _shares(path: Path, arrays: dict[str, np.ndarray], key: str, shape: tuple[int, ...]) -> np.ndarray:
    shares = numbers(path, arrays, key, shape)
    if ((shares < 0) | (shares > 1)).any():
        where = tuple(int(i) for i in np.argwhere((shares < 0) | (shares > 1))[0])
        raise fault(path, key, f"holds {shares[where]} at index {where}; a confidence lies in 0..1")
    return shares.astype(np.float32)
