"""Which frames of a recording poses were made of."""

import numpy as np
from jaxtyping import Int

from ..poses import Poses
from ._recording import Recording


def recording_rows(recording: Recording, poses: Poses) -> Int[np.ndarray, " frames"]:
    """The frame of the recording, counted from 0, that belongs to each frame of the poses, by frame index.

    Raises:
        ValueError: The poses have no frames, or they are not of this recording.
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
    """The row of each frame of the poses among frames of the given numbers.

    Args:
        source: Where the numbers come from, for messages.
        frame_index: Number of each frame that there is.
        poses: The poses.

    Raises:
        ValueError: A frame of the poses is not there.
    """
    row = {number: i for i, number in enumerate(frame_index.tolist())}
    missing = [number for number in poses.frame_index.tolist() if number not in row]
    if missing:
        raise ValueError(
            f"{source}: frame {missing[0]} is not there, of which there is a pose ({len(missing)} of {len(poses)} "
            "frames); give that of the recording that the poses were made of"
        )
    return np.array([row[number] for number in poses.frame_index.tolist()], np.int64)
