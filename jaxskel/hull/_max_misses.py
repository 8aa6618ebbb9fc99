"""Choice of ``max_misses`` for k-of-n voting: how many cameras may see background at an occupied voxel.

The reprojection of a hull fills consistent silhouettes. A hole in one of them carves a tunnel through the hull, which
leaves the silhouettes of all other views unfilled. So the hull itself shows whether masks are good, and how many misses
close the tunnels.
"""

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from ..cameras import Cameras
from ..recording import MIN_VIEWS, Silhouettes, unpack_silhouettes
from ._carve import carve
from ._frame_bits import FRAMES_PER_WORD
from ._grid import make_grid
from ._grid_placement import body_middles
from ._projection_table import ProjectionTable, projection_table
from ._visual_hulls import VisualHulls

_MAX_FRAMES = 24  # evenly spread over the recording
# Edge of the voxels used here (m): larger ones would lose whole limbs between their centres, smaller ones cost more and
# give the same result.
_EDGE = 0.04
_REACH = 1.5  # no part of a person is farther from the middle of the body (m)
# An arm is about a twelfth of a silhouette: hulls that fill less than this share of the best filling lack an arm.
_FILLED = 0.95
# Share of views that must agree. Each allowed miss removes a camera; if over a third are gone, arms and trunk fuse.
_AGREEING = 2 / 3


def most_misses(views: int) -> int:
    """Largest number of misses such that two thirds of the views, and `MIN_VIEWS`, agree that a voxel is occupied."""
    return max(0, views - max(MIN_VIEWS, int(np.ceil(_AGREEING * views))))


def judge_misses(
    cameras: Cameras,
    silhouettes: Silhouettes,
    empty_views: Bool[np.ndarray, "frames cams"],
    min_views: int,
    box: Float[np.ndarray, "2 3"] | None = None,
    at_once: int = FRAMES_PER_WORD,
    hidden: Silhouettes | None = None,
) -> int:
    """Choose ``max_misses`` for [`carve`][]: the smallest number with which the hulls fill the silhouettes.

    The filled share of a silhouette is that of its pixels on the reprojected hull, within a voxel. Its median over
    up to 24 evenly spread frames and their views is compared with the best median over all numbers of misses: pixels
    that no hull fills, such as a blob of noise in one view, are no reason for more misses.

    Args:
        cameras: The rig.
        silhouettes: Packed bits of all frames.
        empty_views: Views that show no person; they neither vote nor need to be filled.
        min_views: Number of cameras that must see a voxel if no miss is allowed; each miss adds one.
        box: Lower and upper corner of the carved volume (m), in the cameras' world; by default around the silhouettes.
        at_once: Frames that are carved at once, see `carve`.
        hidden: Packed bits of pixels where somebody else may stand before the person; they carve nothing.

    Returns:
        0 if the silhouettes are consistent, otherwise up to `most_misses` of the median number of views per frame.
    """
    usable = np.flatnonzero((~empty_views).sum(1) >= MIN_VIEWS)
    if len(usable) == 0:
        return 0
    chosen = usable[np.unique(np.linspace(0, len(usable) - 1, _MAX_FRAMES).astype(int))]
    others = None if hidden is None else hidden[chosen]
    silhouettes, empty_views = silhouettes[chosen], empty_views[chosen]
    possible = silhouettes if others is None else silhouettes | others
    most = most_misses(int(np.median((~empty_views).sum(1))))
    if most == 0:
        return 0
    if box is None:
        middles = body_middles(cameras, silhouettes, empty_views)
        box = np.stack([middles.min(0) - _REACH, middles.max(0) + _REACH])
    grid = make_grid(box[0], box[1], _EDGE)
    table = projection_table(cameras, grid, silhouettes.shape[2], 8 * silhouettes.shape[3])
    filled = []
    for misses in range(most + 1):
        hulls = carve(possible, table.with_min_views(min_views + misses), empty_views, misses, at_once)
        filled.append(float(np.nanmedian(filled_shares(hulls, silhouettes, empty_views, cameras, table))))
        if filled[0] >= _FILLED:
            return 0  # consistent masks: more misses cannot change the result, so one carving is enough
    return int(np.argmax(np.array(filled) >= _FILLED * max(filled)))


def filled_shares(
    hulls: VisualHulls,
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    empty_views: Bool[np.ndarray, "frames cams"],
    cameras: Cameras,
    table: ProjectionTable,
) -> Float[np.ndarray, "frames cams"]:
    """Share of each silhouette that lies on the reprojected hull, within a voxel; NaN in an empty view.

    Counted in square image cells wide enough to leave no gap between voxel centres: drawing each voxel as a square of
    its own size, as [`reproject`][] does, would take far longer.
    """
    height, width = silhouettes.shape[2], 8 * silhouettes.shape[3]
    pixels = table.pixels_at(hulls.voxels)
    points = hulls.centres
    shares = np.full(empty_views.shape, np.nan)
    for f in range(len(hulls)):
        masks = unpack_silhouettes(silhouettes[f], width)
        for c in range(len(cameras)):
            if empty_views[f, c]:
                continue
            drawn = hulls.inside[f] & (pixels[c] < table.unseen)
            side = _cell_side(cameras, c, points[drawn], hulls.grid.spacing) if drawn.any() else 1
            row, column = np.divmod(pixels[c, drawn], width)
            cells = np.zeros((-(-height // side), -(-width // side)), np.uint8)
            cells[row // side, column // side] = 1
            hull = np.empty((side * cells.shape[0], side * cells.shape[1]), np.uint8)
            cv2.resize(cells, hull.shape[::-1], dst=hull, interpolation=cv2.INTER_NEAREST)
            shares[f, c] = (masks[c] & hull.view(bool)[:height, :width]).sum() / masks[c].sum()
    return shares


def _cell_side(cameras: Cameras, camera: int, points: Float[np.ndarray, "n 3"], spacing: float) -> int:
    """Edge (px) of an image cell such that each cell on a solid hull contains a voxel centre."""
    depth = points @ np.asarray(cameras.R[camera, 2]) + float(cameras.t[camera, 2])
    if cameras.are_fisheye[camera]:
        depth = np.linalg.norm(points - cameras.centres[camera], axis=1)
    # Neighbouring columns of voxels are farthest apart along the diagonals of their faces.
    return int(np.ceil(np.sqrt(2) * float(cameras.K[camera, 0, 0]) * spacing / np.median(depth)))
