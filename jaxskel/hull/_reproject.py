"""Reprojection of hulls into the images, and their agreement with the silhouettes."""

import cv2
import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

from ..cameras import Cameras, apparent_depth, in_cameras, on_images
from ._visual_hulls import VisualHulls


class Agreement(eqx.Module):
    """Agreement of one frame's hull with its silhouettes, view by view.

    Attributes:
        coverage: Share of the silhouette that the hull covers; NaN in a view without a silhouette.
        spill: Area of the hull outside the silhouette, as a share of the silhouette; NaN in a view without a
            silhouette.
    """

    coverage: Float[np.ndarray, " cams"]
    spill: Float[np.ndarray, " cams"]


def reproject(
    hulls: VisualHulls, frame: int, cameras: Cameras, height: int, width: int
) -> Bool[np.ndarray, "cams h w"]:
    """Masks (px) of one frame's hull in every view, drawing each voxel as a square of its projected size."""
    points = hulls.centres[hulls.inside[frame]]
    masks = np.zeros((len(cameras), height, width), np.uint8)
    if len(points) == 0:
        return masks.astype(bool)
    seen_from = tuple(np.asarray(a) for a in in_cameras(cameras, points))
    u, v = on_images(cameras, *seen_from)
    depth = apparent_depth(cameras, *seen_from)
    for c in range(len(cameras)):
        seen = np.isfinite(u[c])
        column, row = np.floor(u[c, seen] + 0.5), np.floor(v[c, seen] + 0.5)
        inside = (column >= 0) & (row >= 0) & (column < cameras.size[c, 0]) & (row < cameras.size[c, 1])
        masks[c, row[inside].astype(int), column[inside].astype(int)] = 1
        if inside.any():
            edge = float(cameras.K[c, 0, 0]) * hulls.grid.spacing / np.median(depth[c, seen][inside])
            # Close the gaps between the centres of neighbouring voxels, also along diagonals.
            masks[c] = cv2.morphologyEx(masks[c], cv2.MORPH_CLOSE, _square(2 * edge))
            masks[c] = cv2.dilate(masks[c], _square(edge))
    return masks.astype(bool)


def agreement(hull: Bool[np.ndarray, "cams h w"], silhouettes: Bool[np.ndarray, "cams h w"]) -> Agreement:
    """Compare the reprojected hull of a frame with its silhouettes."""
    area = silhouettes.sum((1, 2)).astype(float)
    area[area == 0] = np.nan
    return Agreement((hull & silhouettes).sum((1, 2)) / area, (hull & ~silhouettes).sum((1, 2)) / area)


def _square(edge: float) -> np.ndarray:
    side = max(1, int(np.ceil(edge)) | 1)
    return np.ones((side, side), np.uint8)
