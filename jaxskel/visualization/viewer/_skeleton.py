"""Draws the skeleton of the poses: joints and tips, bones between them, in the colours of the person."""

import numpy as np

from .. import drawn_bones
from ._figures import Figure
from ._rerun import rr

# Radii of a joint and of a bone of a human at full confidence (m): thinner than a wrist, so that the hull around them
# shows.
_JOINT, _BONE = 0.018, 0.009
# Share of the radius at zero confidence, so that the joint is still visible.
_THINNEST = 0.3


def log_skeleton(stream: rr.RecordingStream, figure: Figure, frame: int) -> None:
    """Log joints, tips and bones of one frame of the poses, thinner at lower confidence; NaN clears them."""
    template, points, colours = figure.poses.template, figure.points(frame), figure.colours
    bone_ends, names = drawn_bones(template), template.point_names
    confidence = figure.poses.confidence[frame].astype(np.float64)
    # A tip is as sure as its joint.
    sure = np.concatenate([confidence, confidence[list(template.tip_parents)]])
    sure = figure.thick * (_THINNEST + (1 - _THINNEST) * sure)
    there = np.isfinite(points).all(1)
    joints = rr.Points3D(
        points[there].astype(np.float32), radii=_JOINT * sure[there], colors=colours[there],
        labels=[names[i] for i in np.flatnonzero(there)], show_labels=False,
    )  # fmt: skip
    stream.log(figure.under("world/skeleton") + "/joints", joints)
    bones = points[bone_ends]
    drawn = np.isfinite(bones).all((1, 2))
    ends = bone_ends[drawn, 0]
    lines = rr.LineStrips3D(bones[drawn].astype(np.float32), radii=_BONE * sure[ends], colors=colours[ends])
    stream.log(figure.under("world/skeleton") + "/bones", lines)
