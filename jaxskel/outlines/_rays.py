"""Viewing rays through the outlines of silhouettes, which graze the surface of the body."""

from functools import lru_cache
from typing import NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from ..cameras import Cameras, rays
from ..recording import Box, person_boxes, unpacked_box

RAYS = 2400
"""Default number of rays per frame: about a quarter of an outline's pixels in ten views of 640 x 480.

With 3600, single frames take 1.13 times as long. Of 1088 hands of crowd, 5 were wrong with 3600 and 6 with 2400; joints
were 10 mm off with either.
"""


class Contours(eqx.Module):
    """Viewing rays through points of the silhouettes' outlines, of all views of a frame together.

    Rays of a true outline graze the body. Unlike the hull's surface, they do not constrain what no view observes.

    Attributes:
        centres: A point on each ray: the optical centre of its camera in the world (m).
        directions: Unit viewing directions in the world.
    """

    centres: Float[Array | np.ndarray, "*frames rays 3"]
    directions: Float[Array | np.ndarray, "*frames rays 3"]

    def thinned(self, factor: int) -> "Contours":
        """Every `factor`-th ray; the rays of a view are in random order."""
        return Contours(self.centres[..., ::factor, :], self.directions[..., ::factor, :])


def contours(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    empty_views: Bool[np.ndarray, "frames cams"],
    count: int = RAYS,
    hidden: UInt8[np.ndarray, "frames cams h w8"] | None = None,
) -> Contours:
    """Rays through the outlines of some frames' silhouettes, the same number from each view.

    An outline runs half-way between person and background pixels. There is no outline where the edge of the image cuts
    the person off, or where somebody else may stand before the person. Points are drawn at random with a fixed seed.

    Args:
        silhouettes: Packed bits.
        cameras: The rig.
        empty_views: Views to leave out.
        count: Number of rays per frame; if there are fewer points, some are repeated, and if there are none at all, all
            rays are NaN.
        hidden: Packed bits of pixels where somebody else may stand before the person.
    """
    own = cameras.centres
    centres, directions = (np.full((len(silhouettes), count, 3), np.nan, np.float32) for _ in range(2))
    for frame, packed in enumerate(silhouettes):
        others = None if hidden is None else hidden[frame]
        which = _write_directions(directions[frame], packed, cameras, empty_views[frame], others)
        if which is not None:
            centres[frame] = own[which]
    return Contours(centres, directions)


def _write_directions(
    directions: Float[np.ndarray, "rays 3"],
    silhouettes: UInt8[np.ndarray, "cams h w8"],
    cameras: Cameras,
    empty_views: Bool[np.ndarray, " cams"],
    hidden: UInt8[np.ndarray, "cams h w8"] | None,
) -> Int[np.ndarray, " rays"] | None:
    """Write the directions of one frame's rays and return the camera of each; None if there is no outline."""
    bent = cameras.bent
    views = []
    for camera, (packed, box) in enumerate(zip(silhouettes, person_boxes(silhouettes), strict=True)):
        if box is None or empty_views[camera]:
            continue
        width, height = cameras.size[camera]
        steps, seen = _steps_in(packed[:height], int(width), box), None
        if hidden is not None:
            steps = _known(steps, hidden[camera, :height], int(width))
        if bent[camera]:  # keep points where the lens is one-to-one
            seen = rays(cameras, camera, steps.points)
            there = np.flatnonzero(np.isfinite(seen).all(1))
            steps, seen = steps.some(there), seen[there]
        if len(steps.place):
            views.append((camera, steps, seen))
    if not views:
        return None
    which, uv = np.zeros(len(directions), int), np.zeros((len(directions), 2))
    ends = np.linspace(0, len(directions), len(views) + 1).astype(int).tolist()
    for (camera, steps, seen), first, end in zip(views, ends[:-1], ends[1:], strict=True):
        drawn = _drawn(len(steps.place), end - first)
        which[first:end], uv[first:end] = camera, steps.some(drawn).points
        if seen is not None:
            directions[first:end] = seen[drawn]
    # All views without distortion at once.
    straight = np.flatnonzero(~bent[which])
    directions[straight] = rays(cameras, which[straight], uv[straight])
    return which


@lru_cache(maxsize=4096)
def _drawn(points: int, share: int) -> Int[np.ndarray, " share"]:
    """Indices of randomly drawn points (fixed seed); if there are too few points, some are repeated."""
    drawn = np.resize(np.random.default_rng(0).permutation(points)[:share], share)
    drawn.flags.writeable = False
    return drawn


def outline(packed: UInt8[np.ndarray, "h w8"], width: int) -> Float[np.ndarray, "n 2"]:
    """Points (u, v) half-way between neighbouring person and background pixels (px)."""
    box = person_boxes(packed)[0]
    return np.zeros((0, 2)) if box is None else _steps_in(packed, width, box).points


class _Steps(NamedTuple):
    """Outline points in compact form, since most of them are never drawn.

    Attributes:
        place: Flat index of the pixel to the left of each point or above it, in some part of an image.
        below: Whether the other pixel is the one below, not the one to the right.
        part: Number of columns, first column and first row of that part (px).
    """

    place: Int[np.ndarray, " n"]
    below: Bool[np.ndarray, " n"]
    part: tuple[int, int, int]

    def some(self, which: Int[np.ndarray, " some"]) -> "_Steps":
        return _Steps(self.place[which], self.below[which], self.part)

    @property
    def points(self) -> Float[np.ndarray, "n 2"]:
        """Points (u, v) half-way between the two pixels (px)."""
        width, left, top = self.part
        v, u = np.divmod(self.place, width)
        half = 0.5 * self.below
        return np.stack([u + (left + 0.5) - half, v + top + half], 1)


def _steps_in(packed: UInt8[np.ndarray, "h w8"], width: int, box: Box) -> _Steps:
    top, bottom, left, right = box
    top, left = max(top - 1, 0), max(left - 1, 0)
    near = unpacked_box(packed, top, bottom + 1, left, min(right + 1, width))
    # Flat arrays are searched several times as fast; the last pixel of a row has no right neighbour.
    row = near.ravel()
    beside = row[1:] ^ row[:-1]
    beside[near.shape[1] - 1 :: near.shape[1]] = False
    across, down = np.flatnonzero(beside), np.flatnonzero(near[1:] ^ near[:-1])
    places = np.concatenate([across, down])
    return _Steps(places, np.arange(len(places)) >= len(across), (near.shape[1], left, top))


def _known(steps: _Steps, hidden: UInt8[np.ndarray, "h w8"], width: int) -> _Steps:
    """The outline points neither of whose pixels is hidden."""
    columns, left, top = steps.part
    near = unpacked_box(hidden, top, len(hidden), left, min(left + columns, width)).ravel()
    other = steps.place + np.where(steps.below, columns, 1)
    return steps.some(np.flatnonzero(~(near[steps.place] | near[other])))
