"""What the silhouettes' outlines say to a body with volume: viewing rays that graze it."""

from functools import lru_cache

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from ._camera import Cameras, rays
from ._views import Box, person_boxes, unpacked_box

RAYS = 3600
"""Rays of a frame, by default: about a third of an outline's pixels in ten views of 640 x 480."""


class Contours(eqx.Module):
    """Viewing rays through points of the silhouettes' outlines, of all views of a frame together.

    A true outline's rays graze the body: unlike the hull's surface, they say nothing about what no view can tell.
    """

    centres: Float[Array | np.ndarray, "*frames rays 3"]
    """A point on each ray: the optical centre of its camera (m)."""
    directions: Float[Array | np.ndarray, "*frames rays 3"]
    """Unit vectors."""

    def thinned(self, factor: int) -> "Contours":
        """One ray of so many: rays are in no order."""
        return Contours(self.centres[..., ::factor, :], self.directions[..., ::factor, :])


def contours(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    lost: Bool[np.ndarray, "frames cams"],
    count: int = RAYS,
) -> Contours:
    """Rays through the outlines of some frames' silhouettes, the same number from each view.

    An outline runs half-way between pixels of person and background. Where a view is cut off by the edge of its image
    there is no outline. Points are drawn without order but always the same.

    Args:
        silhouettes: Packed bits.
        cameras: The rig.
        lost: Views that are left out.
        count: Number of rays of a frame; where there are fewer points, some are given twice, and where there are none
            at all, all rays are NaN.
    """
    own = cameras.centres
    centres, directions = (np.full((len(silhouettes), count, 3), np.nan, np.float32) for _ in range(2))
    for frame, packed in enumerate(silhouettes):
        which = _write_directions(directions[frame], packed, cameras, lost[frame])
        if which is not None:
            centres[frame] = own[which]
    return Contours(centres, directions)


def _write_directions(
    directions: Float[np.ndarray, "rays 3"],
    silhouettes: UInt8[np.ndarray, "cams h w8"],
    cameras: Cameras,
    lost: Bool[np.ndarray, " cams"],
) -> Int[np.ndarray, " rays"] | None:
    """Fill in the rays of one frame, and tell the camera of each; None where there is no outline."""
    bent = (np.asarray(cameras.dist) != 0).any(1)
    views = []
    for camera, (packed, box) in enumerate(zip(silhouettes, person_boxes(silhouettes), strict=True)):
        if box is None or lost[camera]:
            continue
        width, height = cameras.size[camera]
        points, seen = _outline_in(packed[:height], int(width), box), None
        if bent[camera]:  # only what the lens shows one-to-one
            seen = rays(cameras, camera, points)
            there = np.isfinite(seen).all(1)
            points, seen = points[there], seen[there]
        if len(points):
            views.append((camera, points, seen))
    if not views:
        return None
    which, uv = np.zeros(len(directions), int), np.zeros((len(directions), 2))
    ends = np.linspace(0, len(directions), len(views) + 1).astype(int).tolist()
    for (camera, points, seen), first, end in zip(views, ends[:-1], ends[1:], strict=True):
        some = _drawn(len(points), end - first)
        which[first:end], uv[first:end] = camera, points[some]
        if seen is not None:
            directions[first:end] = seen[some]
    # All views without distortion at once.
    straight = np.flatnonzero(~bent[which])
    directions[straight] = rays(cameras, which[straight], uv[straight])
    return which


@lru_cache(maxsize=4096)
def _drawn(points: int, share: int) -> Int[np.ndarray, " share"]:
    """Which of some points are drawn; where there are fewer, some are drawn twice."""
    drawn = np.resize(np.random.default_rng(0).permutation(points)[:share], share)
    drawn.flags.writeable = False
    return drawn


def outline(packed: UInt8[np.ndarray, "h w8"], width: int) -> Float[np.ndarray, "n 2"]:
    """Points (u, v) between neighbouring pixels of which one is person, the other background (px)."""
    box = person_boxes(packed)[0]
    return np.zeros((0, 2)) if box is None else _outline_in(packed, width, box)


def _outline_in(packed: UInt8[np.ndarray, "h w8"], width: int, box: Box) -> Float[np.ndarray, "n 2"]:
    top, bottom, left, right = box
    top, left = max(top - 1, 0), max(left - 1, 0)
    near = unpacked_box(packed, top, bottom + 1, left, min(right + 1, width))
    beside, below = _places(near[:, 1:] ^ near[:, :-1]), _places(near[1:] ^ near[:-1])
    return np.concatenate([beside + [left + 0.5, top], below + [left, top + 0.5]])


def _places(there: Bool[np.ndarray, "rows columns"]) -> Int[np.ndarray, "n 2"]:
    """Column and row of what is true. In one row of numbers it is found several times as fast."""
    v, u = np.divmod(np.flatnonzero(there), there.shape[1])
    return np.stack([u, v], 1)
