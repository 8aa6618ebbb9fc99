"""Do the silhouettes of a frame contradict each other, and by how much?

Every pixel of a silhouette is the image of a point of the body, and all other views that see this point show it on
their silhouettes too. So along the ray of the pixel some point must lie on, or near, all other silhouettes. The misfit
of a pixel is the least distance by which the points of its ray miss the others: zero for true cameras and masks.
Distances are relative to the size of the person in the images, so that the unit of the calibration does not matter.
They are cut off, so that a blob or a hole in a mask counts no more than its area.

After C. Hernandez, F. Schmitt, R. Cipolla: Silhouette Coherence for Camera Calibration under Circular Motion,
PAMI 2007. Unlike carving, the misfit tolerates no view that errs unless it is asked to.
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
# A point counts where no more views than this rule it out, beyond those that may err, and two do not: of all others no
# ray can be explained, even without two suspects.
_SPARE = 2


class Outside(NamedTuple):
    """What a silhouette says of points around the person."""

    distance: Float[np.ndarray, " points"]
    """Distance from the silhouette, in half heights of the person; zero on it, and where the view says nothing."""
    seen: Bool[np.ndarray, " points"]
    cell: Int[np.ndarray, " points"]
    """Cell of the image that the point falls into; the last one where it is not seen."""
    area: Float[np.ndarray, " cells"]
    """Pixels of the silhouette in each cell; none in the last one."""


def outside(
    mask: Bool[np.ndarray, "rows columns"], sight: Sight, frame: int, chosen: slice | Int[np.ndarray, " points"]
) -> Outside:
    """What one silhouette says of the chosen points; nothing, if it shows nobody."""
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
    """What all views of one frame say of the points that can explain a silhouette."""

    distance: Float[np.ndarray, "cams near"]
    """See `Outside`."""
    seen: Bool[np.ndarray, "cams near"]
    cell: Int[np.ndarray, "cams near"]
    area: tuple[Float[np.ndarray, " _"], ...]
    judged: tuple[Bool[np.ndarray, " _"], ...]
    """Cells of each view of which a point is seen by enough other views."""
    near: Int[np.ndarray, " near"]
    """Which points these are."""


def frame_evidence(views: Sequence[Outside], misses: int = 0) -> FrameEvidence:
    """Bring the views of one frame together.

    Args:
        views: What each of them says of all points.
        misses: As many views as may err in `frame_misfits`.
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
    """The same evidence with another silhouette in one view, of which is told what it says of the near points."""
    distance, seen = evidence.distance.copy(), evidence.seen.copy()
    distance[index], seen[index] = view.distance, view.seen
    area = (*evidence.area[:index], view.area, *evidence.area[index + 1 :])
    return replace(evidence, distance=distance, seen=seen, area=area)


def frame_misfits(
    evidence: FrameEvidence, chosen: Bool[np.ndarray, " cams"], misses: int = 0
) -> Float[np.ndarray, " cams"]:
    """By how much the silhouette of each view contradicts the others: the mean over its pixels.

    Args:
        evidence: Of one frame.
        chosen: Views that count.
        misses: As many of the other views may err at any point.

    Returns:
        Misfits in half heights of the person, 0 to `MOST_MISFIT`; NaN where a view is not chosen, shows nobody, or
        shows only what the others do not see.
    """
    found = np.full(len(chosen), np.nan)
    views = [c for c in np.flatnonzero(chosen) if evidence.area[c].any()]
    if len(views) < 2:
        return found
    # The largest distance among the others is the largest of all but for the view that has it, and so on for misses.
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
