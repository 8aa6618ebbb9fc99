"""Chooses the frames of a recording that tell most about its views."""

import numpy as np
from jaxtyping import Int

from ..recording import Silhouettes, silhouette_areas

# Number of candidate frames that are examined.
_CANDIDATES = 32
# If fewer candidates than this show anybody, all frames of the recording are examined.
_FEW = 3
# Largest time shift of a view that is searched (frames); long recordings leave out this many frames at either end.
MOST_STEPS = 12


def telling_frames(silhouettes: Silhouettes, count: int) -> Int[np.ndarray, " some"]:
    """Choose frames: half evenly spread, half where most moves between frames, which reveals clocks that differ.

    Args:
        silhouettes: Silhouettes of the recording.
        count: Largest number of frames to choose.

    Returns:
        Numbers of frames in which at least two views show anything, in ascending order.
    """
    length = len(silhouettes)
    margin = MOST_STEPS if length > 4 * MOST_STEPS else 0
    found = _of_some(silhouettes, np.arange(margin, length - margin), count)
    if len(found) < _FEW < length:  # most frames show nobody
        found = _of_some(silhouettes, np.flatnonzero((silhouette_areas(silhouettes) > 0).sum(1) >= 2), count)
    return found


def _of_some(silhouettes: Silhouettes, frames: Int[np.ndarray, " candidates"], count: int) -> Int[np.ndarray, " some"]:
    """Telling frames among those given, of which only some are examined."""
    if len(frames) == 0:
        return frames
    candidates = frames[np.unique(np.linspace(0, len(frames) - 1, _CANDIDATES).round().astype(int))]
    moved, usable = np.zeros(len(candidates)), np.zeros(len(candidates), bool)
    for i, frame in enumerate(candidates):
        pair = np.asarray(silhouettes[frame : frame + 2])
        areas = silhouette_areas(pair)
        usable[i] = (areas[0] > 0).sum() >= 2
        if len(pair) == 2:
            changed = silhouette_areas(pair[:1] ^ pair[1:])[0]
            moved[i] = (changed / np.maximum(areas.sum(0), 1)).mean()
    candidates, moved = candidates[usable], moved[usable]
    if len(candidates) <= count:
        return candidates
    spread = np.linspace(0, len(candidates) - 1, count - count // 2).round().astype(int)
    moved[spread] = -1.0
    liveliest = np.argsort(-moved, kind="stable")[: count // 2]
    return candidates[np.unique(np.concatenate([spread, liveliest]))]
