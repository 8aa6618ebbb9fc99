"""Viewing rays through outline points, in camera coordinates so that they move with their cameras."""

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from ...cameras import Cameras, rays_in_camera
from ...outlines import outline
from ._distance_images import DistanceImages, onto_outlines

# Largest distance between subpixel outline and pixel outline, except in corners (grid cells).
_NEAR = 1.5


class SightLines(eqx.Module):
    """Viewing rays through the outlines of some frames, in the frames of their cameras.

    Attributes:
        directions: Unit vectors.
        there: False for padding: each view has the same number of rays, whatever the length of its outline.
    """

    directions: Float[Array | np.ndarray, "*frames rays 3"]
    camera: Int[Array | np.ndarray, "*frames rays"]
    there: Bool[Array | np.ndarray, "*frames rays"]


def sight_lines(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    empty_views: Bool[np.ndarray, "frames cams"],
    images: DistanceImages,
    count: int,
) -> SightLines:
    """Rays spread evenly over the outlines of each view. Image edges that cut the person off are no outline.

    Args:
        silhouettes: Packed bits.
        cameras: The rig; extrinsics are not used.
        empty_views: Views to leave out.
        images: Distance images of the same silhouettes, for the subpixel position of the outline.
        count: Number of rays for each view and frame.
    """
    frames, views = empty_views.shape
    points, there = np.zeros((frames, views, count, 2), np.float32), np.zeros((frames, views, count), bool)
    for frame, view in zip(*np.nonzero(~empty_views), strict=True):
        width, height = (int(n) for n in cameras.size[view])
        along = outline(silhouettes[frame, view, :height], width)
        # The points are ordered by row and column, so taking every n-th spreads the rays over the outline.
        chosen = along[np.unique(np.linspace(0, len(along) - 1, min(count, len(along))).astype(int))]
        points[frame, view, : len(chosen)], there[frame, view, : len(chosen)] = chosen, True
    image = np.repeat(np.arange(frames * views, dtype=np.int32), count)
    moved = np.asarray(onto_outlines(images, image, points.reshape(-1, 2)), np.float64).reshape(points.shape)
    there &= np.abs(moved - points).max(-1) < _NEAR * int(images.step)
    directions = np.zeros((frames, views, count, 3))
    for view in range(views):
        seen = rays_in_camera(cameras, view, moved[:, view].reshape(-1, 2))
        directions[:, view] = seen.reshape(frames, count, 3)
    there &= np.isfinite(directions).all(-1)
    # Padding rays look along the optical axis: a finite value, so that no gradient is NaN.
    directions = np.where(there[..., None], directions, [0.0, 0.0, 1.0])
    camera = np.tile(np.repeat(np.arange(views, dtype=np.int32), count), (frames, 1))
    return SightLines(directions.reshape(frames, -1, 3), camera, there.reshape(frames, -1))
