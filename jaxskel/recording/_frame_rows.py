"""Correspondence between the frames of poses and those of the recording that they were made from."""

import numpy as np
from jaxtyping import Int

from ..poses import Poses
from ._recording import Recording


def recording_rows(recording: Recording, poses: Poses) -> Int[np.ndarray, " frames"]:
    """Row of the recording, counted from 0, for each frame of the poses, matched by frame index.

    Raises:
        ValueError: The poses have no frames, or they were not made from this recording.
    """
    if len(poses) == 0:
        raise ValueError("the poses have no frames; give at least one")
    for what, mine, theirs in (("up", recording.up, poses.up), ("frames per second", recording.fps, poses.fps)):
        if mine != theirs:
            raise ValueError(
                f"{recording.name}: {what} {mine} but the poses have {theirs}; give the recording they were made of"
            )
    return rows_by_index(recording.name, recording.frame_index, poses)


def rows_by_index(source: str, frame_index: Int[np.ndarray, " available"], poses: Poses) -> Int[np.ndarray, " frames"]:
    """Row of each frame of the poses in a list of frame numbers.

    Args:
        source: Origin of the numbers, for error messages.
        frame_index: Number of each available frame.
        poses: The poses.

    Raises:
        ValueError: A frame of the poses is missing.
    """
    row = {number: i for i, number in enumerate(frame_index.tolist())}
    missing = [number for number in poses.frame_index.tolist() if number not in row]
    if missing:
        raise ValueError(
            f"{source}: frame {missing[0]} is missing, but has a pose ({len(missing)} of {len(poses)} frames are "
            "missing); give that of the recording that the poses were made of"
        )
    return np.array([row[number] for number in poses.frame_index.tolist()], np.int64)
