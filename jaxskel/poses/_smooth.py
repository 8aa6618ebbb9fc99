"""Low-pass filtering of finished poses over time."""

from collections.abc import Callable
from functools import partial

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int

from .._math.vectors import unit
from .._runtime.kinds import check_kind
from ._poses import Poses
from ._smooth_rotations import filtered_poses

_ORDER = 2  # run forwards and backwards: no delay, and the effect of order four
_SHORTEST = 15  # frames: the filter is started up on as many


def smooth(poses: Poses, cutoff: float) -> Poses:
    """Smooth joints, tips and rotations by a Butterworth filter without delay.

    Rotations and lengths of the bones are smoothed apart, so that a bone whose length is constant keeps it. Frames
    without a pose are left alone and nothing is smoothed across them; nor are runs that are too short to filter.

    Args:
        poses: Consecutive frames.
        cutoff: Frequency (Hz) at which the amplitude falls to half.

    Raises:
        ValueError: The cutoff is not between 0 and half of the frame rate.
    """
    check_kind("poses", poses, Poses, "the Poses of consecutive frames")
    check_kind("cutoff", cutoff, int | float | np.number, "a frequency in hertz")
    if not 0 < cutoff < poses.fps / 2:
        raise ValueError(f"cutoff {cutoff:g} Hz: give one between 0 and {poses.fps / 2:g} Hz, half of the frame rate")
    from scipy import signal  # takes a third of a second, and few smooth

    sections = np.asarray(signal.butter(_ORDER, cutoff, fs=poses.fps, output="sos"))
    low = partial(signal.sosfiltfilt, sections, axis=0)
    points = np.concatenate([poses.joints, poses.tips], 1).astype(np.float64)
    rotations = None if poses.rotations is None else poses.rotations.astype(np.float64)
    for start, stop in _runs(poses.has_pose):
        if stop - start > _SHORTEST:
            part = slice(start, stop)
            if rotations is None or poses.skeleton is None:
                points[part] = _filtered_bones(points[part], poses.template.point_parents, low)
            else:
                points[part], rotations[part] = filtered_poses(points[part], rotations[part], poses.skeleton, low)
    count = len(poses.template.joint_names)
    joints, tips = points[:, :count].astype(np.float32), points[:, count:].astype(np.float32)
    turns = None if rotations is None else rotations.astype(np.float32)
    return eqx.tree_at(
        lambda p: (p.joints, p.tips, p.rotations), poses, (joints, tips, turns), is_leaf=lambda leaf: leaf is None
    )


def _filtered_bones(
    points: Float[np.ndarray, "frames points 3"],
    parents: Int[np.ndarray, " points"],
    low: Callable[[np.ndarray], np.ndarray],
) -> Float[np.ndarray, "frames points 3"]:
    """Filter directions and lengths of the bones, where rotations are not known."""
    new = np.empty_like(points)
    for point, parent in enumerate(parents.tolist()):
        if parent < 0:
            new[:, point] = low(points[:, point])
            continue
        bone = points[:, point] - points[:, parent]
        length = np.linalg.norm(bone, axis=-1, keepdims=True)
        new[:, point] = new[:, parent] + low(length) * unit(low(unit(bone)))
    return new


def _runs(there: Bool[np.ndarray, " frames"]) -> list[tuple[int, int]]:
    """First frame, and frame after the last, of each run of frames that are there."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]])))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]
