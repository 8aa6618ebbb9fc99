"""Frames of a stream that were left out: a person who is followed moved on in them.

A track knows the poses of the last two frames, and continues their motion. Over a gap, both are moved on before the
next frame is followed. Afterwards, the pose of the frame before it is put between those on both sides of the gap:
without that, the motion over the whole gap would be taken for that of one frame.
"""

from dataclasses import replace

import numpy as np
import scipy  # imports its parts when they are first used

from .._math.rotations import nearest_rotation
from ..body import Pose
from ._track_state import Track

# Largest number of frames over which a motion is continued: a fifth of a second at 25 frames per second.
_FORESEEN = 5


def before_next(track: Track, skipped: int) -> Track:
    """The track after some frames that were left out, in which the person moved on with constant velocity."""
    last, before = track.last, track.before
    for _ in range(min(skipped, _FORESEEN)):
        last, before = _onwards(last, before), last
    return replace(track, last=last, before=before)


def over_gap(before: Track, after: Track, skipped: int) -> Track:
    """The track `after` a frame that was followed over a gap, from `before` the gap, with the velocity of one frame.

    A person who was found anew after the gap has no velocity.
    """
    if np.array_equal(after.last.root, after.before.root):
        return after
    (root, rotations), (end_root, end) = _parts(before.last), _parts(after.last)
    share = skipped / (skipped + 1)
    turn = scipy.spatial.transform.Rotation.from_matrix(end @ rotations.swapaxes(-1, -2)).as_rotvec()
    turned = scipy.spatial.transform.Rotation.from_rotvec(share * turn).as_matrix() @ rotations
    return replace(after, before=Pose((1 - share) * root + share * end_root, turned.astype(end.dtype)))


def _parts(pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    return np.asarray(pose.root), np.asarray(pose.rotations)


def _onwards(last: Pose, before: Pose) -> Pose:
    (root, rotations), (old_root, old) = _parts(last), _parts(before)
    turned = nearest_rotation(rotations @ old.swapaxes(-1, -2) @ rotations)
    return Pose(2 * root - old_root, turned.astype(rotations.dtype))
