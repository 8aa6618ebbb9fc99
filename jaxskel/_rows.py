"""Which frames of a recording poses were made of."""

import numpy as np
from jaxtyping import Int

from ._poses import Poses
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
    if np.array_equal(recording.frame_index, poses.frame_index):
        return np.arange(len(poses))
    row = {number: i for i, number in enumerate(recording.frame_index.tolist())}
    missing = [number for number in poses.frame_index.tolist() if number not in row]
    if missing:
        raise ValueError(
            f"{recording.name}: frame {missing[0]} is not there, of which there is a pose ({len(missing)} of "
            f"{len(poses)} frames); give the recording that the poses were made of"
        )
    return np.array([row[number] for number in poses.frame_index.tolist()], np.int64)
