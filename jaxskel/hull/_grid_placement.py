"""Automatic placement of the voxel grid around the person in all frames."""

import numpy as np
from jaxtyping import Bool, Float, UInt8

from ..cameras import Cameras, rays
from ..recording import MIN_VIEWS, Silhouettes, silhouette_centroids
from ._carve import carve
from ._connected_bodies import bodies_among
from ._grid import VoxelGrid, make_grid
from ._others import without_others
from ._projection_table import projection_table
from ._widened_views import steps_for, widened

_COARSE = 3  # edge of a coarse voxel, in fine voxels
_FARTHEST = np.sqrt(3) / 2  # from any point to the nearest centre of a voxel, in edges
_COARSEST = 0.045  # largest edge of a coarse voxel (m): silhouettes are widened by what lies between centres
# Up to this many pixels between their centres, coarse voxels are made finer until it is one: silhouettes are widened by
# whole pixels, and two of them blew grids in small images up by half a metre.
_NEARLY_ONE = 1.5
_REACH = 1.5  # no part of a person is farther from the middle of the body (m)
_MARGIN = 2  # around the coarse hulls, in fine voxels: what touches the edge of a grid may reach out of it
_SAMPLED_MARGIN = 0.25  # the same if only a sample of the frames was carved (m)
# A limb is at most this much nearer to a camera than the middle of the body is (m), and at most half-way to it.
_NEARER = 0.9
_MAX_FRAMES = 96  # carved coarsely, evenly spread over the recording
_LEAST_VOLUME = 0.004  # smaller bodies are noise, not people (m^3)


def place_grid(
    cameras: Cameras,
    silhouettes: Silhouettes,
    empty_views: Bool[np.ndarray, "frames cams"],
    spacing: float,
    min_views: int,
    max_misses: int = 0,
    hidden: Silhouettes | None = None,
) -> VoxelGrid | None:
    """Place a grid around the person in all frames.

    The viewing rays through the centroids of the silhouettes meet in the middle of the body. Hulls are carved coarsely
    around all these points, and the grid is laid around the hulls.

    Args:
        cameras: The rig, in a world with z up.
        silhouettes: Packed bits of all frames; up to 96 of them are used.
        empty_views: Views that show no person.
        spacing: Edge length of a voxel (m).
        min_views: Number of cameras that must see a voxel.
        max_misses: Number of cameras that may miss an occupied voxel.
        hidden: Packed bits of pixels where somebody else may stand before the person; they carve nothing.

    Returns:
        The grid, in the cameras' world, or None if no frame has a hull of a person's size.
    """
    usable = np.flatnonzero((~empty_views).sum(1) >= MIN_VIEWS)
    if len(usable) == 0:
        return None
    chosen = usable[np.unique(np.linspace(0, len(usable) - 1, _MAX_FRAMES).astype(int))]
    margin = _MARGIN * spacing if len(chosen) == len(usable) else _SAMPLED_MARGIN
    others = None if hidden is None else hidden[chosen]
    silhouettes, empty_views = silhouettes[chosen], empty_views[chosen]
    middles = body_middles(cameras, silhouettes, empty_views)
    # Between the centres of coarse voxels there is room for a forearm. Widened by what lies between them, silhouettes
    # lose nothing: each point of a hull is in a coarse voxel that is kept.
    scales = _largest_scales(cameras, middles, empty_views)
    edge = _coarse_edge(spacing, scales)
    # One pixel at least, because the projections of both points are rounded.
    pixels = np.ceil(np.maximum(_FARTHEST * edge * scales, 1) - 1e-6).astype(int)
    coarse = make_grid(middles.min(0) - _REACH, middles.max(0) + _REACH, edge)
    silhouettes = widened(cameras, silhouettes, pixels)
    others = None if others is None else widened(cameras, others, pixels)
    height, width = silhouettes.shape[2], 8 * silhouettes.shape[3]
    table = projection_table(cameras.reduced(steps_for(pixels)), coarse, height, width, min_views)
    possible = silhouettes if others is None else silhouettes | others
    hulls = carve(possible, table, empty_views, max_misses)
    if others is not None:
        hulls = without_others(hulls, table, silhouettes, others)
    bodies = bodies_among(hulls.voxels, coarse)
    voxels = hulls.voxels[bodies.sizes[bodies.voxels_of(0)] * coarse.spacing**3 >= _LEAST_VOLUME]
    if len(voxels) == 0:
        return None
    origin = np.asarray(coarse.origin)
    lower = origin + coarse.spacing * voxels.min(0) - margin
    upper = origin + coarse.spacing * (voxels.max(0) + 1) + margin
    return make_grid(lower, upper, spacing)


def _largest_scales(
    cameras: Cameras, middles: Float[np.ndarray, "frames 3"], empty_views: Bool[np.ndarray, "frames cams"]
) -> Float[np.ndarray, " cams"]:
    """Pixels per metre of each view, at the limb that comes nearest to the camera; 0 where it never sees a person."""
    depths = np.einsum("ci,fi->fc", np.asarray(cameras.R)[:, 2], middles) + np.asarray(cameras.t)[:, 2]
    nearest = np.where(empty_views | (depths <= 0), np.inf, np.maximum(depths - _NEARER, depths / 2)).min(0)
    return np.asarray(cameras.K)[:, [0, 1], [0, 1]].max(1) / nearest


def _coarse_edge(spacing: float, scales: Float[np.ndarray, " cams"]) -> float:
    """Edge of a coarse voxel (m), for voxels of this `spacing` and views of these `scales` (px per m)."""
    edge = min(_COARSE * spacing, _COARSEST)
    between = _FARTHEST * edge * scales.max()
    return edge / between if 1 < between <= _NEARLY_ONE else edge


def body_middles(
    cameras: Cameras,
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    empty_views: Bool[np.ndarray, "frames cams"],
) -> Float[np.ndarray, "frames 3"]:
    """Middle of each body: the point nearest to the rays through the silhouettes' centroids (m, in the world)."""
    centroids = silhouette_centroids(silhouettes)
    directions = np.full((len(silhouettes), len(cameras), 3), np.nan)
    frame, camera = np.nonzero(~empty_views)
    directions[frame, camera] = rays(cameras, camera, centroids[frame, camera])
    across = np.eye(3) - directions[..., :, None] * directions[..., None, :]
    weight = np.isfinite(directions).all(-1).astype(float)
    across = np.nan_to_num(across)
    centres = cameras.centres
    points = np.zeros((len(silhouettes), 3))
    # Iteratively reweighted least squares, because a blob of noise in one view must not pull the point away.
    for _ in range(5):
        left = np.einsum("fc,fcij->fij", weight, across) + 1e-9 * np.eye(3)
        right = np.einsum("fc,fcij,cj->fi", weight, across, centres)
        points = np.linalg.solve(left, right[..., None])[..., 0]
        distance = np.linalg.norm(np.einsum("fcij,fcj->fci", across, points[:, None] - centres), axis=-1)
        weight = np.isfinite(directions).all(-1) / (1 + (distance / 0.2) ** 2)
    return points
