"""Outlines of silhouettes as ordered points, so that turning points can be detected."""

from typing import NamedTuple

import cv2
import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from ...cameras import Cameras, rays_in_camera
from ...recording import unpacked_box
from ._closed_gaps import outline_error, without_gaps
from ._distance_images import DistanceImages, onto_outlines

# Neighbours on either side that decide whether an outline turns (points, which are a pixel or a little more apart).
# Fewer would detect turns of the pixel grid, more would miss fists and feet.
_NEIGHBOURS = 6
# Numbers of points are padded to a multiple of this, so that few sizes are compiled.
_FILLED = 1 << 16


class OutlineChains(eqx.Module):
    """Viewing rays through the outlines of the largest part of each silhouette, including its holes.

    Attributes:
        directions: Unit vectors in the frame of the camera, ordered by frame, then by view.
        neighbours: Indices of the points before and behind each point on its closed outline.
        convex: Whether the person is on the inner side of the turn, as at the tip of a foot, not outside, as in an
            armpit.
        error: Standard deviation of each point, relative to points of smooth outlines.
        first: Index of the first point of each view.
        count: Number of points of each view: zero if it does not show the whole person.
    """

    directions: Float[np.ndarray, "points 3"]
    neighbours: Int[np.ndarray, "points near"]
    convex: Bool[np.ndarray, " points"]
    error: Float[np.ndarray, " points"]
    first: Int[np.ndarray, "frames cams"]
    count: Int[np.ndarray, "frames cams"]


def outline_chains(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    empty_views: Bool[np.ndarray, "frames cams"],
    images: DistanceImages,
) -> OutlineChains:
    """Follow the outlines of some frames; gaps below the pixel resolution are closed first (see `without_gaps`).

    Args:
        silhouettes: Packed bits.
        cameras: The rig; extrinsics are not used.
        empty_views: Views to leave out. Those in which an image edge cuts the person off are left out too.
        images: Distance images of the same silhouettes with gaps closed, for the subpixel position of the outline.
    """
    found = _followed(silhouettes, cameras, empty_views, int(images.step))
    on_outline, directions = _between_pixels(found, cameras, images)
    # Where the lens model is not one-to-one, the points are missing and the outline continues behind the gap.
    seen = np.isfinite(directions).all(1)
    on_outline, directions, owner = on_outline[seen], directions[seen], found.owner[seen]
    lengths = np.bincount(owner)
    start = (np.cumsum(lengths) - lengths)[owner, None]
    away = np.concatenate([np.arange(-_NEIGHBOURS, 0), np.arange(1, _NEIGHBOURS + 1)])
    neighbours = start + (np.arange(len(owner))[:, None] - start + away) % lengths[owner, None]
    before, behind = on_outline - on_outline[neighbours[:, 0]], on_outline[neighbours[:, -1]] - on_outline
    # OpenCV orients outer outlines with the person on the left in the image, and outlines of holes too.
    convex = before[:, 0] * behind[:, 1] - before[:, 1] * behind[:, 0] < 0
    count = np.bincount(found.image[seen], minlength=empty_views.size).reshape(empty_views.shape)
    first = (np.cumsum(count) - count.ravel()).reshape(empty_views.shape)
    return OutlineChains(directions, neighbours, convex, found.error[seen], first, count)


class _Followed(NamedTuple):
    """Points of the outlines at pixel centres.

    Attributes:
        owner: Index of the outline of each point.
        image: Index of the image of each point, ordered by frame, then by view.
    """

    uv: Int[np.ndarray, "points 2"]
    owner: Int[np.ndarray, " points"]
    image: Int[np.ndarray, " points"]
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
    """The points at subpixel accuracy (px), and rays through them."""
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
    """Outlines of the largest connected part of a silhouette (px); none if an image edge cuts it off."""
    height, width = mask.shape
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)
    if len(stats) < 2:
        return []
    largest = 1 + stats[1:, cv2.CC_STAT_AREA].argmax()
    left, top, across, down, _ = stats[largest]
    if left == 0 or top == 0 or left + across == width or top + down == height:
        return []
    found, _ = cv2.findContours((labels == largest).view(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    # A hole hardly longer than the neighbourhood of a point has no turns but those of the pixel grid.
    return [np.asarray(chain[:, 0], int) for chain in found if len(chain) > 2 * _NEIGHBOURS]
