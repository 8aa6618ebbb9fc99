"""Draws the skeleton of the poses: joints and tips, bones between them, colours by side."""

import numpy as np
from jaxtyping import Float

from ...body import SkeletonTemplate
from ...poses import Poses
from .. import colours_of, drawn_bones
from ._rerun import rr

# Radii of a joint and of a bone of a human at full confidence (m): thinner than a wrist, so that the hull around them
# shows.
_JOINT, _BONE = 0.018, 0.009
# Share of the radius at zero confidence, so that the joint is still visible.
_THINNEST = 0.3


def body_points(poses: Poses, frame: int) -> Float[np.ndarray, "points 3"]:
    """Joints followed by tips of one frame in the recording's world (m); NaN if missing."""
    return np.concatenate([poses.joints[frame], poses.tips[frame]]).astype(np.float64)


def log_skeleton(
    stream: rr.RecordingStream,
    template: SkeletonTemplate,
    points: Float[np.ndarray, "points 3"],
    confidence: Float[np.ndarray, " joints"],
    thick: float,
) -> None:
    """Log joints, tips and bones of one frame (m), thinner at lower confidence; NaN clears them.

    Args:
        stream: Destination.
        template: What the points are.
        points: Joints, then tips.
        confidence: Of each joint; a tip is as sure as its joint.
        thick: Thickness relative to a human's bones.
    """
    bone_ends, colours, names = drawn_bones(template), colours_of(template), template.point_names
    sure = np.concatenate([confidence, confidence[list(template.tip_parents)]])
    sure = thick * (_THINNEST + (1 - _THINNEST) * sure)
    there = np.isfinite(points).all(1)
    joints = rr.Points3D(
        points[there].astype(np.float32), radii=_JOINT * sure[there], colors=colours[there],
        labels=[names[i] for i in np.flatnonzero(there)], show_labels=False,
    )  # fmt: skip
    stream.log("world/skeleton/joints", joints)
    bones = points[bone_ends]
    drawn = np.isfinite(bones).all((1, 2))
    ends = bone_ends[drawn, 0]
    lines = rr.LineStrips3D(bones[drawn].astype(np.float32), radii=_BONE * sure[ends], colors=colours[ends])
    stream.log("world/skeleton/bones", lines)
