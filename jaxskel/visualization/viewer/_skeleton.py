"""Draws the skeleton of the poses: joints and tips, bones between them, colours by side."""

import numpy as np
from jaxtyping import Float

from ...body import TIP_PARENTS
from ...poses import Poses
from .. import BONES, COLOURS, POINT_NAMES
from ._rerun import rr

BONE_COLOURS = COLOURS[BONES[:, 0]]

# Radii of a joint and of a bone at full confidence (m): thinner than a wrist, so that the hull around them shows.
_JOINT, _BONE = 0.018, 0.009
# Share of the radius at zero confidence, so that the joint is still visible.
_THINNEST = 0.3


def body_points(poses: Poses, frame: int) -> Float[np.ndarray, "points=20 3"]:
    """Joints followed by tips of one frame in the recording's world (m); NaN if missing."""
    return np.concatenate([poses.joints[frame], poses.tips[frame]]).astype(np.float64)


def log_skeleton(
    stream: rr.RecordingStream, points: Float[np.ndarray, "points=20 3"], confidence: Float[np.ndarray, " joints"]
) -> None:
    """Log joints, tips and bones of one frame (m), thinner at lower confidence; NaN clears them."""
    sure = np.concatenate([confidence, confidence[list(TIP_PARENTS)]])
    sure = _THINNEST + (1 - _THINNEST) * sure
    there = np.isfinite(points).all(1)
    joints = rr.Points3D(
        points[there].astype(np.float32), radii=_JOINT * sure[there], colors=COLOURS[there],
        labels=[POINT_NAMES[i] for i in np.flatnonzero(there)], show_labels=False,
    )  # fmt: skip
    stream.log("world/skeleton/joints", joints)
    bones = points[BONES]
    drawn = np.isfinite(bones).all((1, 2))
    lines = rr.LineStrips3D(
        bones[drawn].astype(np.float32), radii=_BONE * sure[BONES[drawn, 0]], colors=BONE_COLOURS[drawn]
    )
    stream.log("world/skeleton/bones", lines)
