"""k-of-n voting: how many cameras may see background at an occupied voxel, judged from the silhouettes themselves.

Consistent silhouettes are filled by the reprojection of their own hull. A hole in one of them is a tunnel through the
hull, and the tunnel leaves the silhouettes of all other views unfilled: so the hull itself tells poor masks from good
ones, and tells how many misses it takes to close the tunnels.
"""

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from ..cameras import Cameras
from ..recording import MIN_VIEWS, Silhouettes, unpack_silhouettes
from ._carve import carve
from ._grid import make_grid
from ._grid_placement import body_middles
from ._projection_table import ProjectionTable, projection_table
from ._visual_hulls import VisualHulls

_MAX_FRAMES = 24
# Edge length of a voxel here (m): whole limbs are looked for, which fall between the centres of larger voxels. Smaller
# ones cost more and say the same.
_EDGE = 0.04
_REACH = 1.5  # no part of a person is farther from the middle of the body (m)
# An arm is about a twelfth of a silhouette: hulls that fill less than this share of what can be filled lack one.
_FILLED = 0.95
# Each miss forgiven is a camera less that carves. With more than a third of them gone, arms and trunk fuse.
_AGREEING = 2 / 3


def most_misses(views: int) -> int:
    """How many of some views may miss a voxel: two thirds of them, and `MIN_VIEWS`, must agree that it is occupied."""
    return max(0, views - max(MIN_VIEWS, int(np.ceil(_AGREEING * views))))


def judge_misses(
    cameras: Cameras,
    silhouettes: Silhouettes,
    empty_views: Bool[np.ndarray, "frames cams"],
    min_views: int,
    box: Float[np.ndarray, "2 3"] | None = None,
) -> int:
    """Choose ``max_misses`` for [`carve`][]: the smallest number at which the hulls fill the silhouettes.

    A silhouette counts as filled to the share of its pixels that lie on the reprojected hull, give or take a voxel.
    The median over up to 24 frames, evenly spread, and over their views is compared with the best median that any
    number of misses reaches: what no hull fills, such as a blob of noise in one view, is no reason for more misses.

    Args:
        cameras: The rig.
        silhouettes: Packed bits of all frames.
        empty_views: Views that show no person; they neither vote nor are to be filled.
        min_views: So many cameras must see a voxel that may not be missed at all; for each miss, one more.
        box: Lower and upper corner of what to carve (m), in the cameras' world; by default around the silhouettes.

    Returns:
        0 where the silhouettes are consistent, otherwise up to `most_misses` of the views that a frame usually has.
    """
    usable = np.flatnonzero((~empty_views).sum(1) >= MIN_VIEWS)
    if len(usable) == 0:
        return 0
    chosen = usable[np.unique(np.linspace(0, len(usable) - 1, _MAX_FRAMES).astype(int))]
    silhouettes, empty_views = silhouettes[chosen], empty_views[chosen]
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
        hulls = carve(silhouettes, table.with_min_views(min_views + misses), empty_views, misses)
        filled.append(float(np.nanmedian(filled_shares(hulls, silhouettes, empty_views, cameras, table))))
        if filled[0] >= _FILLED:
            return 0  # and no share of what can be filled is larger: consistent masks need one carving only
    return int(np.argmax(np.array(filled) >= _FILLED * max(filled)))


def filled_shares(
    hulls: VisualHulls,
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    empty_views: Bool[np.ndarray, "frames cams"],
    cameras: Cameras,
    table: ProjectionTable,
) -> Float[np.ndarray, "frames cams"]:
    """Share of each silhouette that lies on the reprojected hull, give or take a voxel; NaN in a lost view.

    Counted in square cells of the image that are wide enough to leave no gap between the centres of voxels: drawing
    each voxel as a square of its own size, as [`reproject`][] does, would take far longer.
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
    """Side (px) of a cell into which the centre of a voxel falls wherever the hull is solid."""
    depth = points @ np.asarray(cameras.R[camera, 2]) + float(cameras.t[camera, 2])
    if cameras.are_fisheye[camera]:
        depth = np.linalg.norm(points - cameras.centres[camera], axis=1)
    # Columns of voxels are farthest apart along the diagonals of their faces.
    return int(np.ceil(np.sqrt(2) * float(cameras.K[camera, 0, 0]) * spacing / np.median(depth)))
