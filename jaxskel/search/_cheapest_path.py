"""Which of several tracks a film follows in each frame: the path that is cheapest over all frames."""

import numpy as np
from jaxtyping import Bool, Float, Int

from ._facing import turned_round
from ._track_state import Tracking

# Two poses are the same if no joint differs by more than this (m).
_SAME = 0.05


def apart(
    places: Float[np.ndarray, "*#poses joints 3"], others: Float[np.ndarray, "*#poses joints 3"]
) -> Bool[np.ndarray, "*poses"]:
    """Whether two poses differ, by their joints (m)."""
    return np.linalg.norm(places - others, axis=-1).max(-1) > _SAME


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
    margin = np.where(turned_round(left, other_left), tracking.turn_margin, tracking.margin)
    return np.where(apart(places, others), margin, 0.0)


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
    totals, paths = cheapest_paths(costs, jumps, first)
    return paths[totals.argmin()]


def cheapest_paths(
    costs: Float[np.ndarray, "frames tracks"],
    jumps: Float[np.ndarray, "frames tracks tracks"],
    first: Float[np.ndarray, " tracks"],
) -> tuple[Float[np.ndarray, " tracks"], Int[np.ndarray, "tracks frames"]]:
    """For each track, the summed cost of the cheapest path that ends on it, and that path; see `cheapest_path`."""
    frames, tracks = costs.shape
    total, came = _totals(costs, jumps, first)
    paths = np.zeros((tracks, frames), int)
    paths[:, -1] = np.arange(tracks)
    for frame in range(frames - 1, 0, -1):
        paths[:, frame - 1] = came[frame, paths[:, frame]]
    return total[-1], paths


def costs_through(
    costs: Float[np.ndarray, "frames tracks"],
    jumps: Float[np.ndarray, "frames tracks tracks"],
    first: Float[np.ndarray, " tracks"],
) -> Float[np.ndarray, "frames tracks"]:
    """Summed cost of the cheapest path that is on a track in a frame. Arguments are those of `cheapest_path`."""
    before = _totals(costs, jumps, first)[0]
    after = _totals(costs[::-1], np.roll(jumps[::-1], -1, 0).swapaxes(1, 2), np.zeros(costs.shape[1]))[0][::-1]
    return before + after - costs


def _totals(
    costs: Float[np.ndarray, "frames tracks"],
    jumps: Float[np.ndarray, "frames tracks tracks"],
    first: Float[np.ndarray, " tracks"],
) -> tuple[Float[np.ndarray, "frames tracks"], Int[np.ndarray, "frames tracks"]]:
    """Summed cost of the cheapest path to each track in each frame, and the track that it comes from."""
    total, came = np.zeros(costs.shape), np.zeros(costs.shape, int)
    total[0] = costs[0].astype(np.float64) + first
    for frame in range(1, len(costs)):
        ways = total[frame - 1][:, None] + jumps[frame - 1]
        came[frame] = ways.argmin(0)
        total[frame] = ways.min(0) + costs[frame]
    return total, came
