"""Outlines of silhouettes point after point, so that one can tell where they turn."""

from typing import NamedTuple

import cv2
import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from ...cameras import Cameras, rays_in_camera
from ...recording import unpacked_box
from ._closed_gaps import outline_error, without_gaps
from ._distance_images import DistanceImages, onto_outlines

# Neighbours on either side that tell whether an outline turns (points, which are a pixel or a little more apart). Fewer
# would find turns that are the pixels' own, more would miss fists and feet.
_NEIGHBOURS = 6
# Numbers of points are filled up to a multiple of this, so that few of them are compiled for.
_FILLED = 1 << 16


class OutlineChains(eqx.Module):
    """Viewing rays through the outlines of the largest part of each silhouette, holes in it included."""

    directions: Float[np.ndarray, "points 3"]
    """Unit vectors in the frame of reference of the camera: of all views of the first frame, then of the second."""
    neighbours: Int[np.ndarray, "points near"]
    """The points before and behind each on its outline, which is closed."""
    convex: Bool[np.ndarray, " points"]
    """The person is inside of the turn of the outline, as at the tip of a foot, not outside, as in an armpit."""
    error: Float[np.ndarray, " points"]
    """How much each errs, relative to those of smooth outlines (standard deviations)."""
    first: Int[np.ndarray, "frames cams"]
    """The first point of each view."""
    count: Int[np.ndarray, "frames cams"]
    """Number of its points: none where it does not show all of the person."""


def outline_chains(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    empty_views: Bool[np.ndarray, "frames cams"],
    images: DistanceImages,
) -> OutlineChains:
    """Follow the outlines of some frames, past gaps that pixels do not resolve (see `without_gaps`).

    Args:
        silhouettes: Packed bits.
        cameras: The rig; extrinsics are not used.
        empty_views: Views that are left out. Those where the edge of the image cuts the person off are left out, too.
        images: Of the same silhouettes, without gaps: they tell where between the pixels the outline is.
    """
    found = _followed(silhouettes, cameras, empty_views, int(images.step))
    on_outline, directions = _between_pixels(found, cameras, images)
    # Where a lens shows nothing one-to-one, an outline is followed past the gap.
    seen = np.isfinite(directions).all(1)
    on_outline, directions, owner = on_outline[seen], directions[seen], found.owner[seen]
    lengths = np.bincount(owner)
    start = (np.cumsum(lengths) - lengths)[owner, None]
    away = np.concatenate([np.arange(-_NEIGHBOURS, 0), np.arange(1, _NEIGHBOURS + 1)])
    neighbours = start + (np.arange(len(owner))[:, None] - start + away) % lengths[owner, None]
    before, behind = on_outline - on_outline[neighbours[:, 0]], on_outline[neighbours[:, -1]] - on_outline
    # OpenCV follows an outer outline with the person on its left as one sees the image, that of a hole likewise.
    convex = before[:, 0] * behind[:, 1] - before[:, 1] * behind[:, 0] < 0
    count = np.bincount(found.image[seen], minlength=empty_views.size).reshape(empty_views.shape)
    first = (np.cumsum(count) - count.ravel()).reshape(empty_views.shape)
    return OutlineChains(directions, neighbours, convex, found.error[seen], first, count)


class _Followed(NamedTuple):
    """Points of the outlines along the pixels."""

    uv: Int[np.ndarray, "points 2"]
    owner: Int[np.ndarray, " points"]
    """The outline of each."""
    image: Int[np.ndarray, " points"]
    """Views of the first frame, then of the second."""
    error: Float[np.ndarray, " points"]


def _followed(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    empty_views: Bool[np.ndarray, "frames cams"],
    step: int,
) -> _Followed:
    chains, errors = [np.zeros((0, 2), int)], [np.zeros(0)]
    images: list[int] = []
    for frame, view in zip(*np.nonzero(~empty_views), strict=True):
        width, height = cameras.size[view].tolist()
        mask = unpacked_box(silhouettes[frame, view, :height], 0, height, 0, width)
        found, error = _chains(without_gaps(mask, step)), outline_error(mask, step)
        chains += found
        errors += [error[chain[:, 1], chain[:, 0]] for chain in found]
        images += [int(frame * len(cameras) + view)] * len(found)
    lengths = [len(chain) for chain in chains[1:]]
    owner = np.repeat(np.arange(len(lengths)), lengths)
    return _Followed(np.concatenate(chains), owner, np.array(images, int)[owner], np.concatenate(errors))


def _between_pixels(
    found: _Followed, cameras: Cameras, images: DistanceImages
) -> tuple[Float[np.ndarray, "points 2"], Float[np.ndarray, "points 3"]]:
    """The points where the outlines really are (px), and rays through them."""
    filled = -len(found.uv) % _FILLED
    image, uv = found.image.astype(np.int32), found.uv.astype(np.float32)
    moved = onto_outlines(images, np.pad(image, (0, filled)), np.pad(uv, ((0, filled), (0, 0))))
    moved = np.asarray(moved, np.float64)[: len(uv)]
    directions = np.zeros((len(uv), 3))
    for view in range(len(cameras)):
        own = image % len(cameras) == view
        directions[own] = rays_in_camera(cameras, view, moved[own])
    return moved, directions


def _chains(mask: Bool[np.ndarray, "h w"]) -> list[Int[np.ndarray, "n 2"]]:
    """Outlines of the largest connected part of a silhouette (px); none if an edge of the image cuts it off."""
    height, width = mask.shape
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)
    if len(stats) < 2:
        return []
    largest = 1 + stats[1:, cv2.CC_STAT_AREA].argmax()
    left, top, across, down, _ = stats[largest]
    if left == 0 or top == 0 or left + across == width or top + down == height:
        return []
    found, _ = cv2.findContours((labels == largest).view(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    # A hole that is hardly longer than the neighbours of a point has no turns but the pixels' own.
    return [np.asarray(chain[:, 0], int) for chain in found if len(chain) > 2 * _NEIGHBOURS]
