"""Misfit: how much the silhouettes of a frame contradict each other.

Every pixel of a silhouette is the image of a point of the body, and all other views that see this point show it inside
their silhouettes too. So some point of the pixel's ray must lie in, or near, all other silhouettes. The misfit of a
pixel is the least distance by which the points of its ray miss the others: zero for exact cameras and masks. Distances
are relative to the person's size in the images, so that the unit of the calibration does not matter. They are cut off,
so that a blob or a hole in a mask counts no more than its area.

After C. Hernandez, F. Schmitt, R. Cipolla: Silhouette Coherence for Camera Calibration under Circular Motion,
PAMI 2007. Unlike carving, the misfit tolerates no wrong view unless asked to.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import cv2
import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int

from ._views import Sight

MOST_MISFIT = 0.12
"""Misfits are cut off here, in half heights of the person: about 10 cm."""
# A point is kept if at most this many views rule it out, beyond those that may err, and two do not. No other point can
# explain a ray, even when two suspects are left out.
_SPARE = 2


class Outside(NamedTuple):
    """How one silhouette relates to points around the person.

    Attributes:
        distance: Distance from the silhouette, in half heights of the person; zero inside it, and where the view sees
            nothing.
        cell: Index of the image cell that the point falls into; the last cell if the point is not seen.
        area: Silhouette pixels in each cell; zero in the last one.
    """

    distance: Float[np.ndarray, " points"]
    seen: Bool[np.ndarray, " points"]
    cell: Int[np.ndarray, " points"]
    area: Float[np.ndarray, " cells"]


def outside(
    mask: Bool[np.ndarray, "rows columns"], sight: Sight, frame: int, chosen: slice | Int[np.ndarray, " points"]
) -> Outside:
    """Relate one silhouette to the chosen points; no point is seen if the silhouette is empty."""
    rows, columns = mask.shape
    side = int(sight.side[frame])
    down, across = -(-rows // side), -(-columns // side)
    padded = np.zeros((down * side, across * side), np.uint8)
    padded[:rows, :columns] = mask
    area = np.append(padded.reshape(down, side, across, side).sum((1, 3), dtype=float), 0.0)
    pixel, breadth = sight.pixel[frame, chosen], sight.breadth[frame, chosen]
    seen = (pixel >= 0) & mask.any()
    away = cv2.distanceTransform(1 - mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5).ravel()
    cell = pixel // columns // side * across + pixel % columns // side
    return Outside(np.where(seen, away[pixel] * breadth, 0), seen, np.where(seen, cell, len(area) - 1), area)


class FrameEvidence(eqx.Module):
    """How all views of one frame relate to the points that can explain a silhouette.

    Attributes:
        distance: See `Outside`.
        judged: For each view, the cells with a point that enough other views see.
        near: Indices of these points.
    """

    distance: Float[np.ndarray, "cams near"]
    seen: Bool[np.ndarray, "cams near"]
    cell: Int[np.ndarray, "cams near"]
    area: tuple[Float[np.ndarray, " _"], ...]
    judged: tuple[Bool[np.ndarray, " _"], ...]
    near: Int[np.ndarray, " near"]


def frame_evidence(views: Sequence[Outside], misses: int = 0) -> FrameEvidence:
    """Combine the views of one frame.

    Args:
        views: For each view, how its silhouette relates to all points.
        misses: Number of views that may err in `frame_misfits`.
    """
    distance = np.stack([view.distance for view in views])
    seen = np.stack([view.seen for view in views])
    count = seen.sum(0)
    enough = min(2, len(views) - 2) if len(views) > 2 else 1
    judged = []
    for view in views:
        known = np.zeros(len(view.area), bool)
        known[view.cell[view.seen & (count > enough)]] = True
        judged.append(known)
    most = min(_SPARE + misses, len(views) - 2)
    near = np.flatnonzero(((distance >= MOST_MISFIT).sum(0) <= most) & (count > enough))
    cell = np.stack([view.cell[near] for view in views])
    return FrameEvidence(distance[:, near], seen[:, near], cell, tuple(v.area for v in views), tuple(judged), near)


def with_view(evidence: FrameEvidence, index: int, view: Outside) -> FrameEvidence:
    """The same evidence with another silhouette in one view; `view` covers only the near points."""
    distance, seen = evidence.distance.copy(), evidence.seen.copy()
    distance[index], seen[index] = view.distance, view.seen
    area = (*evidence.area[:index], view.area, *evidence.area[index + 1 :])
    return replace(evidence, distance=distance, seen=seen, area=area)


def frame_misfits(
    evidence: FrameEvidence, chosen: Bool[np.ndarray, " cams"], misses: int = 0
) -> Float[np.ndarray, " cams"]:
    """How much the silhouette of each view contradicts the others: the mean over its pixels.

    Args:
        evidence: Evidence of one frame.
        chosen: Views that count.
        misses: Number of other views that may err at any point.

    Returns:
        Misfits in half heights of the person, 0 to `MOST_MISFIT`; NaN if a view is not chosen, shows nobody, or shows
        only what the others do not see.
    """
    found = np.full(len(chosen), np.nan)
    views = [c for c in np.flatnonzero(chosen) if evidence.area[c].any()]
    if len(views) < 2:
        return found
    # The maximum over the others is the overall maximum, or the second for the view that has it; shifted by `misses`.
    last = min(misses, len(views) - 2)
    highest = -np.partition(-evidence.distance[views], (last, last + 1), axis=0)[[last, last + 1]]
    for c in views:
        area = np.where(evidence.judged[c], evidence.area[c], 0.0)
        if area.any():
            worst = np.where(evidence.distance[c] >= highest[0], highest[1], highest[0])
            use = evidence.seen[c] & (worst < MOST_MISFIT)
            least = np.full(len(area), MOST_MISFIT)
            np.minimum.at(least, evidence.cell[c, use], worst[use])
            found[c] = (least * area).sum() / area.sum()
    return found
