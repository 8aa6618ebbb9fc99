"""Views that show a person: areas, boxes and centroids of silhouettes, and which views are empty."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from ..cameras import Cameras
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
    views = np.ascontiguousarray(silhouettes).reshape(*silhouettes.shape[:2], -1)
    # Counting eight bytes at once takes a fifth of the time.
    whole = views.shape[2] // 8 * 8
    parts = views[..., :whole].view(np.uint64), views[..., whole:]
    return sum((np.bitwise_count(part).sum(2, dtype=np.int64) for part in parts), np.zeros(views.shape[:2], np.int64))


class Box(NamedTuple):
    """Bounding box of the person in an image: rows and columns (px).

    Attributes:
        bottom: One past the last row.
        right: One past the last column.
    """

    top: int
    bottom: int
    left: int
    right: int


def person_boxes(silhouettes: UInt8[np.ndarray, "*views h w8"]) -> list[Box | None]:
    """Bounding box of each silhouette, one view after the other; None if the silhouette is black."""
    views = silhouettes.reshape(-1, *silhouettes.shape[-2:])
    # Read rows as the widest integers that divide them, since there are fewer of these.
    size = next(size for size in (8, 4, 2, 1) if views.shape[2] % size == 0)
    rows = np.bitwise_or.reduce(np.ascontiguousarray(views).view(f"u{size}"), 2) > 0
    columns = np.unpackbits(np.bitwise_or.reduce(views, 1), axis=1)
    spans = ((a.argmax(1), a.shape[1] - a[:, ::-1].argmax(1)) for a in (rows, columns))
    boxes = np.concatenate([np.stack(span, 1) for span in spans], 1).tolist()
    return [Box(*box) if some else None for box, some in zip(boxes, rows.any(1), strict=True)]


def unpacked_box(
    packed: UInt8[np.ndarray, "h w8"], top: int, bottom: int, left: int, right: int
) -> Bool[np.ndarray, "rows columns"]:
    """Unpack part of a silhouette (px): a person covers a tenth of an image, and the rest takes as long to unpack."""
    first = left // 8
    bits = np.unpackbits(packed[top:bottom, first : -(-right // 8)], axis=1)
    return bits[:, left - 8 * first : right - 8 * first].view(bool)


def find_empty_views(areas: Int[np.ndarray, "frames cams"], cameras: Cameras) -> Bool[np.ndarray, "frames cams"]:
    """Mask of the views without a person: black ones and those with specks only."""
    floor = _LEAST_SHARE * cameras.size.prod(1)
    there = areas >= floor
    if areas.size == 0:
        return ~there
    # The median of those that are there, which are last in order: `numpy.nanmedian` takes 30 times as long for a frame.
    count, ordered = there.sum(1), np.sort(np.where(there, areas, -1), axis=1)
    first, last = areas.shape[1] - count, areas.shape[1] - 1
    middle = np.stack([first + (count - 1) // 2, np.minimum(first + count // 2, last)], 1)
    typical = np.take_along_axis(ordered, middle, 1).mean(1)
    return ~there | (areas < _LEAST_OF_MEDIAN * typical[:, None])


def silhouette_centroids(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
) -> Float[np.ndarray, "frames cams 2"]:
    """Centroid (u, v) of every silhouette (px), accurate to four pixels in u; NaN in a black view."""
    counts = np.bitwise_count(silhouettes)
    rows, columns = counts.sum(3, dtype=np.uint16), counts.sum(2, dtype=np.uint16)
    area = rows.sum(2, dtype=np.int64)
    with np.errstate(invalid="ignore"):
        u = (columns * (8 * np.arange(columns.shape[2]) + 3.5)).sum(2) / np.where(area > 0, area, np.nan)
        v = (rows * np.arange(rows.shape[2])).sum(2) / np.where(area > 0, area, np.nan)
    return np.stack([u, v], -1)
