"""Which of several tracks a film follows in each frame: the path that is cheapest over all frames."""

import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..body import SEGMENT_NAMES, Pose
from ._track_state import Tracking

# Two poses are the same if no joint differs by more than this (m).
_SAME = 0.05
# The segments that tell which way a body faces, and their axis that points to the left.
_TRUNK, _LEFT = [SEGMENT_NAMES.index(name) for name in ("pelvis", "chest")], 1


def left_of(poses: Pose) -> Float[Array | np.ndarray, "*poses 3"]:
    """Direction in which the left side of a body lies, twice as long as a unit vector where it is not twisted."""
    return poses.rotations[..., _LEFT][..., _TRUNK, :].sum(-2)


def turned_round(
    left: Float[Array | np.ndarray, "*#poses 3"], other: Float[Array | np.ndarray, "*#poses 3"]
) -> Bool[Array | np.ndarray, "*poses"]:
    """Whether two bodies face opposite ways, from the directions of their left sides."""
    return (left * other).sum(-1) < 0


def jump_costs(
    places: Float[np.ndarray, "*#poses joints 3"],
    others: Float[np.ndarray, "*#poses joints 3"],
    left: Float[np.ndarray, "*#poses 3"],
    other_left: Float[np.ndarray, "*#poses 3"],
    tracking: Tracking,
) -> Float[np.ndarray, "*poses"]:
    """Cost of a jump between two poses of one frame: none between the same, more if they face opposite ways.

    Args:
        places: Joints of the first poses (m).
        others: Joints of the second poses (m).
        left: Directions of the left sides of the first poses, see `left_of`.
        other_left: The same of the second poses.
        tracking: Margins.
    """
    apart = np.linalg.norm(places - others, axis=-1).max(-1) > _SAME
    margin = np.where(turned_round(left, other_left), tracking.turn_margin, tracking.margin)
    return np.where(apart, margin, 0.0)


def cheapest_path(
    costs: Float[np.ndarray, "frames tracks"],
    jumps: Float[np.ndarray, "frames tracks tracks"],
    first: Float[np.ndarray, " tracks"],
) -> Int[np.ndarray, " frames"]:
    """Viterbi path over the tracks: the minimum of the summed costs, those of the jumps between tracks included.

    Args:
        costs: Cost of each track in each frame.
        jumps: Cost of changing from a track to another one after each frame.
        first: Cost of beginning on each track.
    """
    frames, tracks = costs.shape
    total = costs[0].astype(np.float64) + first
    came = np.zeros((frames, tracks), int)
    for frame in range(1, frames):
        ways = total[:, None] + jumps[frame - 1]
        came[frame] = ways.argmin(0)
        total = ways.min(0) + costs[frame]
    path = np.zeros(frames, int)
    path[-1] = total.argmin()
    for frame in range(frames - 1, 0, -1):
        path[frame - 1] = came[frame, path[frame]]
    return path
