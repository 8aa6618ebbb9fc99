"""Epipolar tangents: a plane through two optical centres that touches the body touches both of its silhouettes.

The convex hull of a silhouette is the silhouette of the body's convex hull, so of the planes of a pair of views the two
outermost ones are the same from either side, whatever the pose and whatever hides what. Unlike rays that run deep
through the hull of other views, these tell of errors in both directions.

After S. N. Sinha, M. Pollefeys: Camera Network Calibration and Synchronization from Silhouettes in Archived Video,
IJCV 2010.
"""

import cv2
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from ._camera import Cameras
from ._coherence import Sensitivity
from ._distance_images import DistanceImages
from ._extrinsics import optical_centres
from ._kept import kept
from ._rotations import cross, turned
from ._sight_lines import sight_lines
from ._views import unpacked_box

# Corners of the convex hull of an outline; there are seldom more than half as many.
_CORNERS = 96
# Points of an outline that the corners are found among: all of those of a person who is 1000 px tall.
_POINTS = 5000
# Planes are told from each other by their angle to the one through the middle of the person (rad). Where the other
# camera is seen in front of the person or behind, there is no outermost one.
_WIDEST = 1.3


class ConvexOutlines(eqx.Module):
    """Viewing rays through the corners of convex hulls of silhouettes, in the frames of reference of their cameras."""

    directions: Float[np.ndarray, "frames cams corners 3"]
    """Unit vectors. Where there are fewer corners, some are given again."""
    whole: Bool[np.ndarray, "frames cams"]
    """The view shows all of the person."""


class EpipolarTangents(eqx.Module):
    """Pairs of rays that one plane through both optical centres holds, if the rig is right."""

    cameras: Int[np.ndarray, "pairs 2"]
    directions: Float[np.ndarray, "pairs 2 3"]
    """Of the rays, in the frames of reference of their cameras."""
    there: Bool[np.ndarray, " pairs"]
    """False for pairs that are there to fill up: so there are as many of any rig."""


def convex_outlines(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    lost: Bool[np.ndarray, "frames cams"],
    images: DistanceImages,
) -> ConvexOutlines:
    """Convex hulls of the largest part of each silhouette.

    Args:
        silhouettes: Packed bits.
        cameras: The rig; extrinsics are not used.
        lost: Views that are left out.
        images: Of the same silhouettes: they tell where between the pixels the outline is.
    """
    largest, whole = np.zeros_like(silhouettes), ~lost
    for frame, view in zip(*np.nonzero(~lost), strict=True):
        width, height = cameras.size[view].tolist()
        largest[frame, view, :height], whole[frame, view] = _largest_part(silhouettes[frame, view, :height], width)
    lines = sight_lines(largest, cameras, ~whole, images, _POINTS)
    shape = (*lost.shape, _POINTS)
    every, there = (np.asarray(a).reshape(*shape, *a.shape[2:]) for a in (lines.directions, lines.there))
    directions = np.zeros((*lost.shape, _CORNERS, 3))
    for frame, view in zip(*np.nonzero(whole), strict=True):
        found = every[frame, view][there[frame, view] & (every[frame, view, :, 2] > 0)]
        if len(found) == 0:
            whole[frame, view] = False
            continue
        on_plane = (found[:, :2] / found[:, 2:]).astype(np.float32)
        corners = found[np.asarray(cv2.convexHull(on_plane[:, None], returnPoints=False), int).ravel()]
        chosen = np.linspace(0, len(corners) - 1, _CORNERS).astype(int)
        directions[frame, view] = corners[chosen if len(corners) > _CORNERS else np.arange(_CORNERS) % len(corners)]
    return ConvexOutlines(directions, whole)


def epipolar_tangents(
    cameras: Cameras, outlines: ConvexOutlines, middles: Float[np.ndarray, "frames 3"]
) -> EpipolarTangents:
    """The two outermost planes of each pair of views, looked up for a rig as it is.

    Args:
        cameras: The rig.
        outlines: Of some frames.
        middles: Of the person in each frame (m).
    """
    R, centres = np.asarray(cameras.R, float), cameras.centres
    rays = np.einsum("cji,fcrj->fcri", R, outlines.directions)
    first, second = np.triu_indices(len(cameras), 1)
    pairs = np.stack([first, second], 1)
    with np.errstate(
        invalid="ignore"
    ):  # optical centres that are one, or in the middle of the person: NaN from here on
        baseline = _unit(centres[second] - centres[first])
        middle = middles[:, None] - centres[first]
        middle = _unit(middle - np.einsum("fpi,pi->fp", middle, baseline)[..., None] * baseline)
    across = np.cross(baseline, middle)
    found, there = np.zeros((2, len(middles), len(pairs), 2, 3)), np.ones((len(middles), len(pairs)), bool)
    every = np.arange(len(middles))[:, None]
    for side in range(2):
        own = rays[:, pairs[:, side]]
        angle = np.arctan2(np.einsum("fpri,fpi->fpr", own, across), np.einsum("fpri,fpi->fpr", own, middle))
        # NaN compares false.
        there &= outlines.whole[:, pairs[:, side]] & (np.abs(angle).max(2) < _WIDEST)
        for end, corner in enumerate((angle.argmin(2), angle.argmax(2))):
            found[end, :, :, side] = outlines.directions[every, pairs[:, side], corner]
    return EpipolarTangents(np.tile(pairs, (2 * len(middles), 1)), found.reshape(-1, 2, 3), np.tile(there.ravel(), 2))


@kept
def tangent_sensitivity(cameras: Cameras, tangents: EpipolarTangents) -> Sensitivity:
    """By how much the planes of each pair miss each other (px), 0 where there is none, and how that begins to change.

    The angle between the planes over the standard deviation that it has if each ray errs by one pixel.
    """
    pair = jnp.asarray(tangents.cameras)
    K = jnp.asarray(cameras.K)
    given = (
        jnp.asarray(cameras.R)[pair], optical_centres(cameras)[pair], ((K[:, 0, 0] + K[:, 1, 1]) / 2)[pair],
        jnp.asarray(tangents.directions), jnp.asarray(tangents.there),
    )  # fmt: skip

    def one(
        change: Float[Array, "2 6"], R: Array, centres: Array, focal: Array, directions: Array, there: Array
    ) -> Float[Array, ""]:
        rays = jnp.einsum("cji,cj->ci", turned(change[:, :3], R), directions)
        centres = centres + change[:, 3:]
        baseline = centres[1] - centres[0]
        baseline = baseline / jnp.sqrt((baseline**2).sum() + 1e-20)
        # What is not there has one plane for both rays, and so no angle and no slope.
        planes = jnp.where(there, cross(jnp.broadcast_to(baseline, rays.shape), rays), jnp.eye(3)[0])
        angle = jnp.arctan2(baseline @ cross(planes[0], planes[1]), planes[0] @ planes[1])
        # A ray that errs by a pixel turns its plane the more, the nearer it is to the other optical centre.
        spread = jnp.sqrt((1 / (focal**2 * (planes**2).sum(-1))).sum())
        return angle / spread

    value, slopes = jax.vmap(jax.value_and_grad(one))(jnp.zeros((len(pair), 2, 6)), *given)
    every = jnp.arange(len(pair), dtype=jnp.int32)[:, None]
    return Sensitivity(value, jnp.zeros((len(pair), len(cameras), 6)).at[every, pair].add(slopes))


def _unit(vectors: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3"]:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _largest_part(packed: UInt8[np.ndarray, "h w8"], width: int) -> tuple[UInt8[np.ndarray, "h w8"], bool]:
    """The largest connected part of a silhouette, and whether no edge of the image cuts it off."""
    mask = unpacked_box(packed, 0, len(packed), 0, width)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)
    if len(stats) < 2:
        return np.zeros_like(packed), False
    largest = 1 + stats[1:, cv2.CC_STAT_AREA].argmax()
    left, top, across, down, _ = stats[largest]
    whole = bool(left > 0 and top > 0 and left + across < width and top + down < len(packed))
    kept = np.zeros((len(packed), 8 * packed.shape[1]), bool)
    kept[:, :width] = labels == largest
    return np.packbits(kept, axis=1), whole
