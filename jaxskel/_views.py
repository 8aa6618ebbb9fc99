"""Which views of a frame show a person at all."""

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from ._camera import Cameras
from ._silhouettes import AbstractSilhouettes, Silhouettes

# A person covers at least this share of an image; less is noise.
_LEAST_SHARE = 5e-4
# A view with less than this share of the frame's median silhouette has lost the person.
_LEAST_OF_MEDIAN = 0.05
# Fewer silhouettes do not bound a volume.
MIN_VIEWS = 3


def silhouette_areas(silhouettes: Silhouettes) -> Int[np.ndarray, "frames cams"]:
    """Number of person pixels in every view."""
    if isinstance(silhouettes, AbstractSilhouettes):
        return np.concatenate([silhouette_areas(batch) for batch in silhouettes.batches()])
    return np.bitwise_count(silhouettes).sum((2, 3), dtype=np.int64)


def lost_views(areas: Int[np.ndarray, "frames cams"], cameras: Cameras) -> Bool[np.ndarray, "frames cams"]:
    """Views without a person: black ones and those with specks only."""
    floor = _LEAST_SHARE * cameras.size.prod(1)
    there = areas >= floor
    # In a frame where nobody is there all views count, to spare the median of nothing; the floor takes them anyway.
    counted = np.where(there | ~there.any(1, keepdims=True), areas, np.nan)
    typical = np.nanmedian(counted, axis=1) if areas.size else np.zeros(len(areas))
    return ~there | (areas < _LEAST_OF_MEDIAN * typical[:, None])


def silhouette_centroids(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
) -> Float[np.ndarray, "frames cams 2"]:
    """Centroid (u, v) of every silhouette (px), to four pixels in u; NaN in a black view."""
    counts = np.bitwise_count(silhouettes)
    rows, columns = counts.sum(3, dtype=np.uint16), counts.sum(2, dtype=np.uint16)
    area = rows.sum(2, dtype=np.int64)
    with np.errstate(invalid="ignore"):
        u = (columns * (8 * np.arange(columns.shape[2]) + 3.5)).sum(2) / np.where(area > 0, area, np.nan)
        v = (rows * np.arange(rows.shape[2])).sum(2) / np.where(area > 0, area, np.nan)
    return np.stack([u, v], -1)
