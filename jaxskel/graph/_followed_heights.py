"""The paper's remedy for raised hands: local maxima of height, followed in time."""

import equinox as eqx
import numpy as np
from jaxtyping import Float, Int

from ..body import Skeleton
from ..hull import VisualHulls

_STATURE = 1.75  # stature for which the sizes below hold (m)


class FollowedHeights(eqx.Module):
    """Follows the head among the local maxima of height over the frames that it is given (Sect. 3.1).

    Head and raised hands are local maxima of the hull's upper surface. The head is the one that stays above the middle
    of the person, at most the stature above the feet, and moves least from frame to frame: of all sequences of maxima
    the cheapest, found by dynamic programming. In a film, frames are in order; for single frames movement tells little.

    All sizes hold for a body of 1.75 m; they are scaled with the skeleton's stature.

    Attributes:
        least_rise: A maximum rises by this much above the saddle to a higher one (m). A head rises by 0.2 m above the
            shoulders, but beside raised arms by less.
        most: Highest maxima kept in each frame.
        wander: Horizontal distance from the middle of the hull that costs as much as `jump` (m).
        jump: Distance between frames that costs as much as `wander` (m).
        above: Height above the stature that costs as much (m): heads are there only in a jump, or on toes.
        below: Height below the stature that costs as much (m). On slim bodies in two films of 1960 frames it gets fewer
            heads wrong than 0.2, 0.4 and 1 m.
    """

    least_rise: float = 0.04
    most: int = eqx.field(static=True, default=6)
    wander: float = 0.15
    jump: float = 0.05
    above: float = 0.05
    below: float = 0.1

    def roots(self, hulls: VisualHulls, skeleton: Skeleton) -> Int[np.ndarray, " frames"]:
        """Index into ``hulls.voxels`` of the root of each person's graph; 0 for an empty hull."""
        scale = skeleton.stature / _STATURE / hulls.grid.spacing  # voxels in a metre of a body of 1.75 m
        tall = _STATURE * scale
        roots = np.zeros(len(hulls), np.int64)
        frames = np.flatnonzero(hulls.inside.any(1))
        if len(frames) == 0:
            return roots
        tops, away = [], []
        for f in frames:
            own = hulls.occupied(f)
            found = own[_maxima(hulls.voxels[own], self.least_rise * scale)][: self.most]
            middle, floor = hulls.voxels[own, :2].mean(0), hulls.voxels[own, 2].min()
            rise = (hulls.voxels[found, 2] - floor - tall) / scale
            over = np.where(rise > 0, rise / self.above, -rise / self.below)
            tops.append(found)
            away.append(np.hypot(*(hulls.voxels[found, :2] - middle).T) / (self.wander * scale) + over)
        places = [hulls.voxels[found] for found in tops]
        chosen = _cheapest_path(away, places, self.jump * scale)
        roots[frames] = [found[k] for found, k in zip(tops, chosen, strict=True)]
        return roots


def _maxima(voxels: Int[np.ndarray, "own 3"], rise: float) -> Int[np.ndarray, " maxima"]:
    """Indices of the local maxima of the upper surface, from the highest down; of a plateau, the one in the middle.

    Columns join from the highest down; a group of them that meets a higher one has a maximum if it rises enough.
    """
    last = np.append(np.flatnonzero((np.diff(voxels[:, :2], axis=0) != 0).any(1)), len(voxels) - 1)
    columns, heights = voxels[last, :2] - voxels[:, :2].min(0) + 1, voxels[last, 2]
    label = np.full(columns.max(0) + 2, -1)
    tops: list[list[int]] = []  # of each group, its highest columns
    parent: list[int] = []
    kept: list[list[int]] = []
    for column in np.argsort(-heights, kind="stable").tolist():
        x, y = columns[column]
        around = {_group(parent, int(g)) for g in label[x - 1 : x + 2, y - 1 : y + 2].ravel() if g >= 0}
        if not around:
            label[x, y] = len(parent)
            parent.append(len(parent))
            tops.append([column])
            continue
        first = min(around, key=lambda g: (-heights[tops[g][0]], g))
        label[x, y] = first
        for group in around - {first}:
            if heights[tops[group][0]] - heights[column] >= rise:
                kept.append(tops[group])
            elif heights[tops[group][0]] == heights[tops[first][0]]:
                tops[first] += tops[group]
            parent[group] = first
        if heights[column] == heights[tops[first][0]]:
            tops[first].append(column)
    kept += [tops[g] for g in range(len(parent)) if parent[g] == g]
    kept.sort(key=lambda plateau: -heights[plateau[0]])
    return last[[_in_the_middle(columns, plateau) for plateau in kept]]


def _in_the_middle(columns: Int[np.ndarray, "columns 2"], plateau: list[int]) -> int:
    places = columns[plateau]
    return plateau[int(((places - places.mean(0)) ** 2).sum(1).argmin())]


def _group(parent: list[int], group: int) -> int:
    while parent[group] != group:
        group = parent[group]
    return group


def _cheapest_path(away: list[Float[np.ndarray, " _"]], places: list[Int[np.ndarray, "_ 3"]], jump: float) -> list[int]:
    """Which maximum of each frame: the sequence with the least sum of costs and distances over `jump`."""
    costs, before = [away[0]], []
    for own, last, now in zip(away[1:], places[:-1], places[1:], strict=True):
        steps = costs[-1] + np.linalg.norm(now[:, None] - last[None], axis=-1) / jump
        before.append(steps.argmin(1))
        costs.append(own + steps.min(1))
    path = [int(costs[-1].argmin())]
    for choices in reversed(before):
        path.append(int(choices[path[-1]]))
    return path[::-1]
