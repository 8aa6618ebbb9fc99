"""What the silhouettes' outlines say to a body with volume: viewing rays that graze it."""

from collections.abc import Callable

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from ._camera import Cameras, rays
from ._views import person_box, unpacked_box

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
    centres = cameras.centres
    found = Contours(*(np.full((len(silhouettes), count, 3), np.nan, np.float32) for _ in range(2)))
    for frame in range(len(silhouettes)):
        views = [
            (centres[camera], *_rays(silhouettes[frame, camera], cameras, int(camera)))
            for camera in np.flatnonzero(~lost[frame])
        ]
        views = [(centre, points, at) for centre, points, at in views if points]
        shares = np.diff(np.linspace(0, count, len(views) + 1).astype(int)) if views else []
        first = 0
        for (centre, points, at), share in zip(views, shares, strict=True):
            own = slice(first, first + share)
            found.centres[frame, own] = centre
            found.directions[frame, own] = at(np.resize(np.random.default_rng(0).permutation(points)[:share], share))
            first += share
    return found


def _rays(
    packed: UInt8[np.ndarray, "h w8"], cameras: Cameras, camera: int
) -> tuple[int, Callable[[Int[np.ndarray, " some"]], Float[np.ndarray, "some 3"]]]:
    """How many points of an outline the lens shows one-to-one, and what gives the directions of some of them."""
    width, height = cameras.size[camera]
    points = outline(packed[:height], int(width))
    if not np.asarray(cameras.dist)[camera].any():
        return len(points), lambda some: rays(cameras, camera, points[some])
    directions = rays(cameras, camera, points)
    directions = directions[np.isfinite(directions).all(1)]
    return len(directions), lambda some: directions[some]


def outline(packed: UInt8[np.ndarray, "h w8"], width: int) -> Float[np.ndarray, "n 2"]:
    """Points (u, v) between neighbouring pixels of which one is person, the other background (px)."""
    box = person_box(packed)
    if box is None:
        return np.zeros((0, 2))
    top, bottom, left, right = box
    top, left = max(top - 1, 0), max(left - 1, 0)
    near = unpacked_box(packed, top, bottom + 1, left, min(right + 1, width))
    beside, below = _places(near[:, 1:] ^ near[:, :-1]), _places(near[1:] ^ near[:-1])
    return np.concatenate([beside + [left + 0.5, top], below + [left, top + 0.5]])


def _places(there: Bool[np.ndarray, "rows columns"]) -> Int[np.ndarray, "n 2"]:
    """Column and row of what is true. In one row of numbers it is found several times as fast."""
    v, u = np.divmod(np.flatnonzero(there), there.shape[1])
    return np.stack([u, v], 1)
