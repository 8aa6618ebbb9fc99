"""Puts the refined poses of a batch together: back in the recording's world, with statuses and uncertainties."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..body import Skeleton
from ..hull import Seen
from ..poses import Poses, Status
from ..refinement import Refined
from ._start import Start


class FramesOf(NamedTuple):
    """The world and the frames that poses are given in.

    Attributes:
        to_z_up: Rotation from this world to one with z up, in which all stages work.
    """

    to_z_up: Float[np.ndarray, "3 3"]
    up: str
    fps: float
    frame_index: Int[np.ndarray, " frames"]


def assemble(
    frames: FramesOf,
    skeleton: Skeleton,
    seen: Seen,
    start: Start | None,
    refined: Refined | None,
    stature_deviation: float | None = None,
) -> Poses:
    """The poses of a batch.

    Args:
        frames: Their world and their numbers.
        skeleton: The subject's skeleton.
        seen: The people in these frames.
        start: Where the refinement started; None if nobody is seen.
        refined: Refined poses of these people (m, in the world with z up); None if nobody is seen.
        stature_deviation: Standard deviation of the skeleton's stature (m), if it was found.

    Returns:
        Poses in the world of the frames (m), NaN where there are none, with a status for each frame.
    """
    count, status, good = len(seen.status), seen.status.copy(), seen.frames
    joints, tips = np.full((count, 15, 3), np.nan, np.float32), np.full((count, 5, 3), np.nan, np.float32)
    rotations = np.full((count, 17, 3, 3), np.nan, np.float32)
    covariance, confidence = np.full((count, 15, 3, 3), np.nan, np.float32), np.zeros((count, 15), np.float32)
    sides = np.full(count, 0.5, np.float32)
    if start is not None and refined is not None:
        status[good[~start.plausible]] = Status.NO_MATCH
        fitted = start.plausible & refined.finite
        status[good[start.plausible & ~refined.finite]] = Status.FAILED
        status[good[fitted & ~refined.converged]] = Status.NOT_CONVERGED
        done = good[fitted]
        status[done[(status[done] == Status.OK) & seen.empty_views[done].any(1)]] = Status.VIEW_LOST
        back = frames.to_z_up.T.astype(np.float32)
        joints[done], tips[done] = refined.joints[fitted] @ back.T, refined.tips[fitted] @ back.T
        rotations[done] = back @ refined.pose.rotations[fitted]
        uncertainty = start.uncertainty(refined)
        covariance[done] = back @ uncertainty.covariance[fitted] @ back.T
        confidence[done], sides[done] = uncertainty.confidence[fitted], start.sides[fitted]
    return Poses(
        joints, tips, rotations, skeleton, confidence, sides, status, frames.fps, frames.up, frames.frame_index,
        covariance, stature_deviation,
    )  # fmt: skip
