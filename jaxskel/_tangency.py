"""How well silhouettes of different views agree, from their outermost epipolar tangents alone.

A plane through two optical centres that touches the person touches both silhouettes, and of the planes of a pair of
views the two outermost belong together, see `_epipolar_tangents`. By how much they miss each other is known to a part
of a pixel and needs neither voxels nor anything that is compiled. It tells of shifts that hulls hardly notice: of all
images by 27 of 480 px, hulls of ten views lose 5 % of the silhouettes, while the planes miss each other by ten times as
much.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from ._camera import Cameras, rays
from ._views import person_boxes, unpacked_box

# As in `_epipolar_tangents`: beyond this the other camera is in front of the person or behind, and none is outermost.
_WIDEST = 1.3


@dataclass(frozen=True)
class ConvexOutline:
    """The convex hull of the outline of a silhouette's largest part."""

    uv: Float[np.ndarray, "points 2"]
    """Centres of pixels (px)."""
    cut: Bool[np.ndarray, " points"]
    """At the edge of the image, where the person may go on."""


def convex_outline(packed: UInt8[np.ndarray, "h w8"], width: int, height: int) -> ConvexOutline | None:
    """The convex outline of a packed silhouette in an image of this size (px); None where it is black."""
    box = person_boxes(packed[None, :height])[0]
    if box is None:
        return None
    mask = unpacked_box(packed, *box).view(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    largest = 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())
    outlines, _ = cv2.findContours((labels == largest).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    uv = cv2.convexHull(outlines[0])[:, 0].astype(float) + [box.left, box.top]
    return ConvexOutline(uv, ((uv <= 0) | (uv >= [width - 1, height - 1])).any(1))


def tangent_misses(
    cameras: Cameras, outlines: Mapping[tuple[int, int], ConvexOutline]
) -> dict[tuple[int, int], list[float]]:
    """By how much the outermost planes of each pair of views miss each other in each frame.

    Args:
        cameras: The rig.
        outlines: By frame and view.

    Returns:
        By the two views, the misses of all frames: angles between planes over the standard deviation that they have if
        each ray errs by a pixel, so about px.
    """
    centres, focal = cameras.centres, np.asarray(cameras.K)[:, [0, 1], [0, 1]].mean(1)
    seen = {key: rays(cameras, key[1], outline.uv) for key, outline in outlines.items()}
    misses: dict[tuple[int, int], list[float]] = {}
    for one, other in combinations(range(len(cameras)), 2):
        baseline = centres[other] - centres[one]
        length = np.linalg.norm(baseline)
        found = misses.setdefault((one, other), [])
        if length < 1e-9:
            continue
        for frame in sorted({f for f, view in outlines if view == one} & {f for f, view in outlines if view == other}):
            first, second = (frame, one), (frame, other)
            middle = np.nanmean(seen[first], 0)
            found += _between(
                (seen[first], seen[second]), (outlines[first].cut, outlines[second].cut), baseline / length, middle,
                (focal[one], focal[other]),
            )  # fmt: skip
    return misses


def _between(
    seen: tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "m 3"]],
    cut: tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, " m"]],
    baseline: Float[np.ndarray, "3"],
    middle: Float[np.ndarray, "3"],
    focal: tuple[float, float],
) -> list[float]:
    """The misses of one pair of views in one frame."""
    ahead = middle - (middle @ baseline) * baseline
    ahead = ahead / np.linalg.norm(ahead)
    side = np.cross(baseline, ahead)
    angles = [np.arctan2(directions @ side, directions @ ahead) for directions in seen]
    if not max(np.abs(angle).max() for angle in angles) < _WIDEST:  # nor where a lens shows nothing one-to-one
        return []
    found = []
    for outermost in (np.argmax, np.argmin):
        places = [int(outermost(angle)) for angle in angles]
        if any(edge[place] for edge, place in zip(cut, places, strict=True)):
            continue
        across = [np.linalg.norm(np.cross(baseline, rays[place])) for rays, place in zip(seen, places, strict=True)]
        spread = np.hypot(1 / (focal[0] * across[0]), 1 / (focal[1] * across[1]))
        found.append(float(abs(angles[0][places[0]] - angles[1][places[1]]) / spread))
    return found
