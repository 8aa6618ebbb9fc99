"""Epipolar tangents: a plane through two optical centres that touches the body touches both silhouettes.

Where such an epipolar plane touches the body, in a frontier point, it is tangent to both outlines. Unlike rays that run
deep through the hull of other views, these planes reveal errors in both directions. For each pair of views, the two
outermost planes correspond whatever the pose and the occlusions, since the convex hull of a silhouette is the
silhouette of the body's convex hull. Inner planes, at a hand, an elbow or a hip, are paired if they nearly coincide
for a nearly right rig.

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

# If the other camera appears in front of or behind the person, planes surround it and none is outermost: their angle to
# the plane through the middle of the person exceeds this (rad).
_WIDEST = 1.3
# Largest number of planes that touch an outline from one side, counted from the outermost inwards.
_PLANES = 12
# Capacity: mean number of tangents for each frame and pair of views, twice as many as ten views have.
_ROOM = 8
# Two planes are only paired if no other plane comes within this many gates of either.
_ALONE = 2.0


class EpipolarTangents(eqx.Module):
    """Pairs of rays that lie in one plane through both optical centres if the rig is right.

    Attributes:
        directions: Directions of the rays, each in the frame of its camera.
        error: Standard deviation of each ray, relative to that of rays through smooth outlines.
        alike: Number of tangents with common errors, as their rays share outline points; mean of both rays.
        there: False for padding, which makes the number of tangents the same for any rig.
    """

    cameras: Int[np.ndarray, "tangents 2"]
    directions: Float[np.ndarray, "tangents 2 3"]
    error: Float[np.ndarray, "tangents 2"]
    alike: Float[np.ndarray, " tangents"]
    there: Bool[np.ndarray, " tangents"]


class _Planes(NamedTuple):
    """Planes through the optical centres of a view and each other view that are tangent to an outline of the first.

    The second axis separates planes with the outline at larger angles from those with it at smaller angles; both are
    ordered from the outermost inwards.

    Attributes:
        angle: Angle to the plane through the middle of the person, about the baseline (rad); NaN for padding.
        spread: Standard deviation of the angle, if rays through smooth outlines err by a pixel (rad).
        point: Index of the tangent point among all outline points.
        outermost: Whether the first planes enclose the whole person.
    """

    angle: Float[np.ndarray, "*views 2 planes"]
    spread: Float[np.ndarray, "*views 2 planes"]
    point: Int[np.ndarray, "*views 2 planes"]
    outermost: Bool[np.ndarray, "*views"]


def epipolar_tangents(
    cameras: Cameras, outlines: OutlineChains, middles: Float[np.ndarray, "frames 3"], gate: float
) -> EpipolarTangents:
    """Find the planes that are tangent to the outlines of two views, for the rig as it is.

    Args:
        cameras: The rig.
        outlines: Outlines of some frames.
        middles: Middle of the person in each frame (world, m).
        gate: Largest miss of two inner planes that are paired (px, see `tangent_sensitivity`).
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
    """Planes through one view and each other view that are tangent to its outline in one frame."""
    first, count = outlines.first[frame, view], outlines.count[frame, view]
    own = slice(first, first + count)
    rays, centres = outlines.directions[own] @ np.asarray(cameras.R[view], float), cameras.centres
    with np.errstate(invalid="ignore"):  # equal optical centres, or one inside the person: NaN from here on
        # Orient the baseline from the first view of a pair to the second, whichever of them `view` is.
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
    """Which planes of two views may coincide."""
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
    """How far the planes of each pair miss each other (px), 0 for padding, and the derivatives.

    The residual is the angle between the planes over its standard deviation if each ray errs by one pixel, or by more
    for rays through poorly resolved outlines.
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
        # Padding has the same plane for both rays, so its angle and derivatives are zero.
        planes = jnp.where(there, cross(jnp.broadcast_to(baseline, rays.shape), rays), jnp.eye(3)[0])
        angle = jnp.arctan2(baseline @ cross(planes[0], planes[1]), planes[0] @ planes[1])
        # The nearer a ray is to the other optical centre, the more an error of one pixel turns its plane.
        spread = jnp.sqrt(((error / focal) ** 2 / (planes**2).sum(-1)).sum())
        return angle / spread

    value, slopes = jax.vmap(jax.value_and_grad(one))(jnp.zeros((len(pair), 2, 6)), *given)
    every = jnp.arange(len(pair), dtype=jnp.int32)[:, None]
    return Sensitivity(value, jnp.zeros((len(pair), len(cameras), 6)).at[every, pair].add(slopes))


def _turn(angles: Float[np.ndarray, "*batch"]) -> Float[np.ndarray, "*batch"]:
    """Angles wrapped to within half a turn of zero (rad)."""
    return angles - 2 * np.pi * np.round(angles / (2 * np.pi))


def _unit(vectors: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3"]:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
