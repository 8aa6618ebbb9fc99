"""Epipolar tangents: a plane through two optical centres that touches the body touches both of its silhouettes.

Where a plane of the pencil through two optical centres touches the body, both outlines turn back from it: in a frontier
point. Unlike rays that run deep through the hull of other views, these tell of errors in both directions. Of each pair
of views the two outermost planes belong together, whatever the pose and whatever hides what, since the convex hull of a
silhouette is the silhouette of the body's convex hull. Of all others, at a hand, an elbow or a hip, those do that are
nearly one plane by a rig that is nearly right.

After R. Cipolla, K. E. Astrom, P. J. Giblin: Motion from the Frontier of Curved Surfaces, ICCV 1995, and S. N. Sinha,
M. Pollefeys: Camera Network Calibration and Synchronization from Silhouettes in Archived Video, IJCV 2010.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..._math.rotations import cross, turned
from ..._runtime.compile_cache import cached_jit
from ...cameras import Cameras, optical_centres
from ._coherence import Sensitivity
from ._outline_chains import OutlineChains

# Where the other camera is seen in front of the person or behind, planes go all around it and none is outermost: their
# angle to the one through the middle of the person goes beyond this (rad).
_WIDEST = 1.3
# Of the planes that touch an outline from one side, so many at most, from the outermost inwards.
_PLANES = 12
# There is room for so many tangents of a pair of views in a frame on average, twice as many as there are of ten views.
_ROOM = 8
# No other plane comes within so many gates of two that are taken for one.
_ALONE = 2.0


class EpipolarTangents(eqx.Module):
    """Pairs of rays that one plane through both optical centres holds, if the rig is right."""

    cameras: Int[np.ndarray, "tangents 2"]
    directions: Float[np.ndarray, "tangents 2 3"]
    """Of the rays, in the frames of reference of their cameras."""
    error: Float[np.ndarray, "tangents 2"]
    """How much they err, relative to those through smooth outlines (standard deviations)."""
    alike: Float[np.ndarray, " tangents"]
    """So many err together, as their rays go through the same places of the outlines, on average of both."""
    there: Bool[np.ndarray, " tangents"]
    """False for those that are there to fill up: so there are as many of any rig."""


class _Planes(NamedTuple):
    """Planes through the optical centres of a view and each other view that touch an outline of the first.

    On the second axis are those that have the outline at larger angles, then those that have it at smaller ones, each
    from the outermost inwards.
    """

    angle: Float[np.ndarray, "*views 2 planes"]
    """To the plane through the middle of the person, about the line from one centre to the other (rad); or NaN."""
    spread: Float[np.ndarray, "*views 2 planes"]
    """Of the angle, if rays through smooth outlines err by a pixel (rad)."""
    point: Int[np.ndarray, "*views 2 planes"]
    """Of all outlines."""
    outermost: Bool[np.ndarray, "*views"]
    """The first planes have all of the person between them."""


def epipolar_tangents(
    cameras: Cameras, outlines: OutlineChains, middles: Float[np.ndarray, "frames 3"], gate: float
) -> EpipolarTangents:
    """Planes that touch the outlines of two views, looked up for a rig as it is.

    Args:
        cameras: The rig.
        outlines: Of some frames.
        middles: Of the person in each frame (m).
        gate: By how much two planes that are not outermost may miss each other (px, see `tangent_sensitivity`).
    """
    pairs = np.stack(np.triu_indices(len(cameras), 1), 1)
    first, second = pairs.T
    frames, room = len(middles), _ROOM * len(pairs)
    which, there = np.zeros((frames, room), int), np.zeros((frames, room), bool)
    points = np.zeros((frames, room, 2), int)
    for frame, middle in enumerate(middles):
        views = [_touching(cameras, outlines, frame, view, middle) for view in range(len(cameras))]
        planes = _Planes(*(np.stack(of_all) for of_all in zip(*views, strict=True)))
        one, other = (_Planes(*(a[own, its] for a in planes)) for own, its in ((first, second), (second, first)))
        pair, side, i, j = (found[:room] for found in np.nonzero(_are_one(one, other, gate)))
        which[frame, : len(pair)], there[frame, : len(pair)] = pair, True
        points[frame, : len(pair)] = np.stack([one.point[pair, side, i], other.point[pair, side, j]], 1)
    there, points = there.ravel(), points.reshape(-1, 2)
    uses = np.bincount(points[there].ravel(), minlength=len(outlines.directions))
    beside = uses[outlines.neighbours].sum(1) + uses
    if len(beside) == 0:
        rays = np.zeros((len(there), 2, 3)), np.ones((len(there), 2))
        return EpipolarTangents(pairs[which.ravel()], *rays, np.ones(len(there)), there)
    alike = np.maximum(beside[points].mean(1), 1.0)
    return EpipolarTangents(pairs[which.ravel()], outlines.directions[points], outlines.error[points], alike, there)


def _touching(
    cameras: Cameras, outlines: OutlineChains, frame: int, view: int, middle: Float[np.ndarray, "3"]
) -> _Planes:
    """Planes of the pencils of one view with each other that touch its outline in one frame."""
    first, count = outlines.first[frame, view], outlines.count[frame, view]
    own = slice(first, first + count)
    rays, centres = outlines.directions[own] @ np.asarray(cameras.R[view], float), cameras.centres
    with np.errstate(invalid="ignore"):  # one optical centre, or one in the middle of the person: NaN from here on
        # From the first view of a pair to the second, whichever of them this is.
        baseline = _unit(np.sign(np.arange(len(cameras)) - view)[:, None] * (centres - centres[view]))
        middle = middle - centres[view]
        middle = _unit(middle - (baseline @ middle)[:, None] * baseline)
    angle = np.arctan2(np.cross(baseline, middle) @ rays.T, middle @ rays.T)
    beside = _turn(angle[:, outlines.neighbours[own] - first] - angle[..., None])
    touches = np.stack([(beside > 0).all(-1), (beside < 0).all(-1)], 1) & outlines.convex[own]

    other, side, point = np.nonzero(touches)
    order = np.lexsort((np.where(side == 0, 1, -1) * angle[other, point], side, other))
    other, side, point = other[order], side[order], point[order]
    rank = np.arange(len(order)) - np.searchsorted(2 * other + side, 2 * other + side)
    some = rank < _PLANES
    there, other, point = (other[some], side[some], rank[some]), other[some], point[some]
    angles, spreads = np.full((2, len(cameras), 2, _PLANES), np.nan)
    points = np.zeros(angles.shape, int)
    angles[there], points[there] = angle[other, point], first + point
    K = np.asarray(cameras.K[view], float)
    across = np.linalg.norm(np.cross(baseline[other], rays[point]), axis=-1)
    spreads[there] = 2 * outlines.error[first + point] / ((K[0, 0] + K[1, 1]) * np.maximum(across, 1e-10))
    return _Planes(angles, spreads, points, (count > 0) & (np.abs(angle) < _WIDEST).all(1))


def _are_one(one: _Planes, other: _Planes, gate: float) -> Bool[np.ndarray, "pairs 2 planes planes"]:
    """Which planes of two views may be one."""
    apart = np.abs(_turn(one.angle[..., :, None] - other.angle[..., None, :]))
    apart /= np.hypot(one.spread[..., :, None], other.spread[..., None, :])
    # NaN compares false.
    near = apart < _ALONE * gate
    found = (apart < gate) & (near.sum(-1, keepdims=True) == 1) & (near.sum(-2, keepdims=True) == 1)
    outermost = one.outermost & other.outermost
    found[outermost, :, 0], found[outermost, :, :, 0] = False, False
    found[outermost, :, 0, 0] = np.isfinite(apart[outermost, :, 0, 0])
    return found


@cached_jit
def tangent_sensitivity(cameras: Cameras, tangents: EpipolarTangents) -> Sensitivity:
    """By how much the planes of each pair miss each other (px), 0 where there is none, and how that begins to change.

    The angle between the planes over the standard deviation that it has if each ray errs by one pixel, those through
    outlines that pixels do not resolve by more.
    """
    pair = jnp.asarray(tangents.cameras)
    K = jnp.asarray(cameras.K)
    given = (
        jnp.asarray(cameras.R)[pair], optical_centres(cameras)[pair], ((K[:, 0, 0] + K[:, 1, 1]) / 2)[pair],
        jnp.asarray(tangents.directions), jnp.asarray(tangents.error), jnp.asarray(tangents.there),
    )  # fmt: skip

    def one(
        change: Float[Array, "2 6"],
        R: Array,
        centres: Array,
        focal: Array,
        directions: Array,
        error: Array,
        there: Array,
    ) -> Float[Array, ""]:
        rays = jnp.einsum("cji,cj->ci", turned(change[:, :3], R), directions)
        centres = centres + change[:, 3:]
        baseline = centres[1] - centres[0]
        baseline = baseline / jnp.sqrt((baseline**2).sum() + 1e-20)
        # What is not there has one plane for both rays, and so no angle and no slope.
        planes = jnp.where(there, cross(jnp.broadcast_to(baseline, rays.shape), rays), jnp.eye(3)[0])
        angle = jnp.arctan2(baseline @ cross(planes[0], planes[1]), planes[0] @ planes[1])
        # A ray that errs by a pixel turns its plane the more, the nearer it is to the other optical centre.
        spread = jnp.sqrt(((error / focal) ** 2 / (planes**2).sum(-1)).sum())
        return angle / spread

    value, slopes = jax.vmap(jax.value_and_grad(one))(jnp.zeros((len(pair), 2, 6)), *given)
    every = jnp.arange(len(pair), dtype=jnp.int32)[:, None]
    return Sensitivity(value, jnp.zeros((len(pair), len(cameras), 6)).at[every, pair].add(slopes))


def _turn(angles: Float[np.ndarray, "*batch"]) -> Float[np.ndarray, "*batch"]:
    """Angles within half a turn of zero (rad)."""
    return angles - 2 * np.pi * np.round(angles / (2 * np.pi))


def _unit(vectors: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3"]:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
