"""Puts the refined poses of a batch together: back in the recording's world, with statuses and uncertainties."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..body import HUMAN_15, Skeleton, SkeletonTemplate
from ..hull import Seen
from ..poses import Poses, Status
from ..recording import Recording
from ..refinement import Refined
from ._carried import carried
from ._prepared import Prepared
from ._settings import Settings
from ._start import Start


class FramesOf(NamedTuple):
    """The world and the frames that poses are given in.

    Attributes:
        to_z_up: Rotation from this world to one with z up, in which all stages work.
        scale: Size of the world of all stages over this one.
        template: The template to give poses of, if it is not that of the stages.
    """

    to_z_up: Float[np.ndarray, "3 3"]
    up: str
    fps: float
    frame_index: Int[np.ndarray, " frames"]
    scale: float = 1.0
    template: SkeletonTemplate | None = None


def frames_of(part: Recording, prepared: Prepared, settings: Settings) -> FramesOf:
    """The world and the frames of a part of a recording."""
    # Without a search, the template itself was matched and refined.
    given = None if settings.template is None or settings.search is None else settings.template.template
    other = None if given == HUMAN_15 else given
    return FramesOf(prepared.to_z_up, part.up, part.fps, part.frame_index, prepared.scale, other)


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
    rows, ends, segments = (len(names) for names in _names(skeleton.template))
    joints, tips = np.full((count, rows, 3), np.nan, np.float32), np.full((count, ends, 3), np.nan, np.float32)
    rotations = np.full((count, segments, 3, 3), np.nan, np.float32)
    covariance, confidence = np.full((count, rows, 3, 3), np.nan, np.float32), np.zeros((count, rows), np.float32)
    sides = np.full(count, 0.5, np.float32)
    if start is not None and refined is not None:
        status[good[~start.plausible]] = Status.NO_MATCH
        fitted = start.plausible & refined.finite
        status[good[start.plausible & ~refined.finite]] = Status.FAILED
        status[good[fitted & ~refined.converged]] = Status.NOT_CONVERGED
        done = good[fitted]
        status[done[(status[done] == Status.OK) & seen.empty_views[done].any(1)]] = Status.VIEW_LOST
        back = frames.to_z_up.T.astype(np.float32)
        joints[done], tips[done] = (
            points[fitted] @ back.T / np.float32(frames.scale) for points in (refined.joints, refined.tips)
        )
        rotations[done] = back @ refined.pose.rotations[fitted]
        uncertainty = start.uncertainty(refined)
        covariance[done] = back @ uncertainty.covariance[fitted] @ back.T / np.float32(frames.scale) ** 2
        confidence[done] = uncertainty.confidence[fitted]
        sides[done] = np.minimum(start.sides, uncertainty.facing)[fitted]
    poses = Poses(
        joints, tips, rotations, skeleton.scaled(1 / frames.scale), confidence, sides, status, frames.fps, frames.up,
        frames.frame_index, covariance, stature_deviation, skeleton.template,
    )  # fmt: skip
    return poses if frames.template is None else carried(poses, frames.template)


def _names(template: SkeletonTemplate) -> tuple[tuple[str, ...], ...]:
    return template.joint_names, template.tip_names, template.segment_names
