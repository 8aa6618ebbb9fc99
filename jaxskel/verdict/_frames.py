"""Which frames of a recording tell most about its views."""

import numpy as np
from jaxtyping import Int

from ..recording import Silhouettes, silhouette_areas

# Frames that are looked at, to choose from.
_CANDIDATES = 32
# Of a long recording that shows somebody in fewer of those, all frames are looked at.
_FEW = 3
# Views may be out of step by so many frames: the ends of a long recording are left out.
MOST_STEPS = 12


def telling_frames(silhouettes: Silhouettes, count: int) -> Int[np.ndarray, " some"]:
    """Half of them evenly spread, half where most moves from frame to frame: there, clocks that differ show.

    Args:
        silhouettes: Of the recording.
        count: As many at most.

    Returns:
        Numbers of frames in which at least two views show anything, in ascending order.
    """
    length = len(silhouettes)
    margin = MOST_STEPS if length > 4 * MOST_STEPS else 0
    found = _of_some(silhouettes, np.arange(margin, length - margin), count)
    if len(found) < _FEW < length:  # mostly, nobody is there
        found = _of_some(silhouettes, np.flatnonzero((silhouette_areas(silhouettes) > 0).sum(1) >= 2), count)
    return found


def _of_some(silhouettes: Silhouettes, frames: Int[np.ndarray, " candidates"], count: int) -> Int[np.ndarray, " some"]:
    """Telling frames among those given, of which some are looked at."""
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
