"""Puts the refined poses of a batch together: back in the recording's world, with statuses and uncertainties."""

import numpy as np

from ..hull import Seen
from ..poses import Poses, Status
from ..recording import Recording
from ..refinement import Refined
from ._prepared import Prepared
from ._start import Start


def assemble(part: Recording, prepared: Prepared, seen: Seen, start: Start | None, refined: Refined | None) -> Poses:
    """The poses of a batch.

    Args:
        part: The frames; only their facts are used.
        prepared: Result of `prepare` for the recording.
        seen: The people in these frames.
        start: Where the refinement started; None if nobody is seen.
        refined: Refined poses of these people (m, in the world with z up); None if nobody is seen.

    Returns:
        Poses in the recording's world (m), NaN where there are none, with a status for each frame.
    """
    count, status, good = len(part.frame_index), seen.status.copy(), seen.frames
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
        back = prepared.to_z_up.T.astype(np.float32)
        joints[done], tips[done] = refined.joints[fitted] @ back.T, refined.tips[fitted] @ back.T
        rotations[done] = back @ refined.pose.rotations[fitted]
        uncertainty = start.uncertainty(refined)
        covariance[done] = back @ uncertainty.covariance[fitted] @ back.T
        confidence[done], sides[done] = uncertainty.confidence[fitted], start.sides[fitted]
    return Poses(
        joints, tips, rotations, prepared.skeleton, confidence, sides, status, part.fps, part.up,
        part.frame_index, covariance, prepared.stature_deviation,
    )  # fmt: skip
