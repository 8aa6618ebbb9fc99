"""Writes joint angles as MOT, the motion file of OpenSim, and as a table for spreadsheets."""

import csv
import io
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ..._math.euler import to_zxy
from ..._runtime.atomic_files import written_whole
from ..._runtime.plain_text import plain
from ...body import HUMAN_15
from ...poses import STATUS_NAMES, Poses, joint_angles
from ._markers import with_up

# From the axes of OpenSim and ISB (X to the front, Y up, Z to the right) to the body frame (x to the front, y to the
# left, z up).
_FROM_ISB = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
# OpenSim counts pronation from palms that face the front, joint angles from palms that face the thighs.
_PALMS_AHEAD = np.pi / 2


def write_mot(path: str | Path, poses: Poses) -> Path:
    """Write joint angles and the place of the pelvis as a motion for OpenSim's full-body models.

    Columns have the names, signs and order of rotations of the coordinates of Rajagopal et al. (2016): degrees, metres,
    +Y up, the world of `write_trc`. Those that this model does not have (`knee_adduction_r`, `neck_extension`, ...) are
    there for models that do. The pelvis' rotations are in OpenSim's order, tilt first, so they depend on where the
    person faces. ``pelvis_tx``, ``pelvis_ty`` and ``pelvis_tz`` are the middle between the hips.

    OpenSim's models have oblique axes of knee, ankle and elbow; they follow to some degrees. Inverse kinematics of the
    TRC follow the joints more closely.

    Of a template other than the paper's human, the columns are the flexions of its hinges, and no others.

    A frame without a pose has no row; OpenSim interpolates. Times are those of `write_trc`.

    Args:
        path: The file; its folder is created if missing.
        poses: Frames at `poses.fps`.

    Returns:
        The path.

    Raises:
        ValueError: There is no pose, the rotations are not known, or the template has no hinges.
    """
    path, known = Path(path), poses.has_pose
    if not known.any():
        raise ValueError(f"{path}: no frame has a pose: there is no motion")
    names, values = coordinates(poses)
    lines = [
        # A line break in the name would corrupt the header.
        plain(" ".join(path.stem.split())), "version=1", f"nRows={known.sum()}", f"nColumns={1 + len(names)}",
        "inDegrees=yes", "endheader", "\t".join(["time", *names]),
    ]  # fmt: skip
    for i in np.flatnonzero(known):
        lines.append("\t".join([f"{i / poses.fps:.9f}", *(f"{value:.6f}" for value in values[i])]))
    with written_whole(path) as file:
        file.write("\n".join([*lines, ""]).encode())
    return path


def coordinates(poses: Poses) -> tuple[tuple[str, ...], Float[np.ndarray, "frames coordinates"]]:
    """Names of OpenSim's coordinates, and their values: degrees, and metres of ``pelvis_tx``, ``_ty`` and ``_tz``."""
    angles = joint_angles(poses)
    if poses.template != HUMAN_15:
        return angles.names, np.rad2deg(angles.values)
    standing = with_up(poses, "+Y")
    known = poses.has_pose
    values = angles.values.copy()
    pelvis = np.asarray(standing.pose.rotations, np.float64)[known, :1] @ _FROM_ISB
    # Tilt, list, rotation: about Z, X and Y of the ground. The pelvis is not turned in the neutral posture.
    values[known, :3] = to_zxy(pelvis, home=2.0)[:, 0]
    values[:, [name.startswith("pro_sup") for name in angles.names]] += _PALMS_AHEAD
    return (
        (*angles.names[:3], "pelvis_tx", "pelvis_ty", "pelvis_tz", *angles.names[3:]),
        np.concatenate([np.rad2deg(values[:, :3]), standing.joints[:, 0], np.rad2deg(values[:, 3:])], 1),
    )


def write_angles(path: str | Path, poses: Poses) -> Path:
    """Write the angles of `jaxskel.poses.joint_angles` as a CSV: degrees, empty cells where there is no pose.

    Returns:
        The path.

    Raises:
        ValueError: The rotations are not known, or the template has no hinges.
    """
    path, angles = Path(path), joint_angles(poses)
    with written_whole(path) as file, io.TextIOWrapper(file, "utf-8", newline="") as text:
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(["frame_index", "time_s", "status", *(f"{name}_deg" for name in angles.names)])
        for i, values in enumerate(np.rad2deg(angles.values)):
            cells = [f"{value:.4f}" if poses.has_pose[i] else "" for value in values]
            rows.writerow([str(poses.frame_index[i]), f"{i / poses.fps:.6f}", STATUS_NAMES[poses.status[i]], *cells])
    return path
