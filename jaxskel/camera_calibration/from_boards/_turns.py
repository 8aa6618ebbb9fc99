"""Decides which end of a symmetric board each camera took for the first.

The silhouettes of a person decide. Candidates are the choices for which the rays through the middles of the silhouettes
meet best. The hull carved from the right choice must cover the silhouettes, and no other choice's may.
"""

from itertools import product

import equinox as eqx
import numpy as np
from jaxtyping import Bool, UInt8

from ...cameras import Cameras, rays
from ...hull import VoxelGrid, agreement, body_middles, carve, projection_table, reproject
from ...recording import find_empty_views, silhouette_areas, silhouette_centroids, unpack_silhouettes

# Half a turn about the normal of the board.
HALF_TURN = np.diag([-1.0, -1.0, 1.0])
_FRAMES = 3
_CARVED = 8  # number of choices to carve: those of one more camera than a minimal rig of three
_VOXEL, _REACH = 0.04, 1.2  # voxel edge of the coarse hull, and its reach from the middle of the person (m)
# The right choice covers at least this share of each silhouette, even with coarse voxels and masks with holes; every
# other choice must cover less by this margin.
_LEAST, _MARGIN = 0.8, 0.1


def settle_turns(
    cameras: Cameras, silhouettes: UInt8[np.ndarray, "frames cams h w8"]
) -> tuple[Bool[np.ndarray, " cams"], float] | None:
    """Find the cameras that took the board's other end for the first, relative to the first camera.

    Args:
        cameras: The rig, in the frame of the board (m).
        silhouettes: Packed bits of a person who does not only stand in the middle of the board.

    Returns:
        Which cameras must be turned, and the resulting coverage of the silhouettes; None if the silhouettes do not
        decide.
    """
    empty_views = find_empty_views(silhouette_areas(silhouettes), cameras)
    whole = np.flatnonzero(~empty_views.any(1))
    if len(whole) == 0:
        return None
    some = whole[np.unique(np.linspace(0, len(whole) - 1, _FRAMES).astype(int))]
    silhouettes = silhouettes[some]
    choices = [np.array((False, *rest)) for rest in product((False, True), repeat=len(cameras) - 1)]
    meets = [_rays_apart(turned(cameras, choice), silhouettes) for choice in choices]
    likely = [choices[i] for i in np.argsort(meets)[:_CARVED]]
    covered = np.array([_coverage(turned(cameras, choice), silhouettes) for choice in likely])
    order = np.argsort(-covered)
    best = covered[order[0]]
    if best < _LEAST or (len(order) > 1 and covered[order[1]] > best - _MARGIN):
        return None
    return likely[order[0]], float(best)


def turned(cameras: Cameras, which: Bool[np.ndarray, " cams"]) -> Cameras:
    """The rig with some cameras moved by half a turn about the board's normal."""
    R = np.where(which[:, None, None], np.asarray(cameras.R) @ HALF_TURN, np.asarray(cameras.R))
    return eqx.tree_at(lambda c: c.R, cameras, R)


def _rays_apart(cameras: Cameras, silhouettes: np.ndarray) -> float:
    """Distance by which rays through the middles of silhouettes miss each other (m); infinite behind a camera."""
    middles = body_middles(cameras, silhouettes, np.zeros(silhouettes.shape[:2], bool))
    centroids = silhouette_centroids(silhouettes)
    away = []
    for c in range(len(cameras)):
        directions, toward = rays(cameras, c, centroids[:, c]), middles - cameras.centres[c]
        depth = (toward * directions).sum(1)
        off = np.linalg.norm(toward - depth[:, None] * directions, axis=1)
        away.append(np.where(depth > 0, off, np.inf))
    return float(np.mean(away))


def _coverage(cameras: Cameras, silhouettes: np.ndarray) -> float:
    """Share of each silhouette that a coarse hull around the person covers: the worst view, averaged over frames."""
    height, width = silhouettes.shape[2], 8 * silhouettes.shape[3]
    cells = round(2 * _REACH / _VOXEL)
    found = []
    for i, middle in enumerate(body_middles(cameras, silhouettes, np.zeros(silhouettes.shape[:2], bool))):
        grid = VoxelGrid(middle - _REACH, _VOXEL, (cells, cells, cells))
        table = projection_table(cameras, grid, height, width, min_views=len(cameras))
        hulls = carve(silhouettes[i : i + 1], table)
        seen = reproject(hulls, 0, cameras, height, width)
        found.append(agreement(seen, unpack_silhouettes(silhouettes[i], width)).coverage.min())
    return float(np.mean(found))
