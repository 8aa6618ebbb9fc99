"""Virtual silhouettes: volumes as cameras around them would see them, so that the search can work with them."""

from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from .._runtime.kinds import check_count
from ..body import Skeleton
from ..cameras import Cameras, project
from ..hull import VoxelGrid, observed_edge
from ..recording import MIN_VIEWS, Recording, pack_silhouettes, rotation_to_z_up
from ._virtual_cameras import virtual_cameras
from ._volumes import Volumes, hulls_of, make_volumes, upright_grid

VIRTUAL_CAMERAS = 8
"""Number of virtual cameras. From hulls of two test sequences, 8 and 12 give a median error of 10.3 and 9.0 mm, 8.1 and
8.3 mm."""
# Radius of the disc that a voxel is drawn as, in edges of a voxel: above half of its diagonal, so that there are no
# holes between discs. What this makes too wide is taken off again. The outlines are then 2.8 mm off those of four
# capsules, 60 to 240 mm wide, with voxels of 15 mm, and 6.9 mm with voxels of 30 mm. Discs of half an edge leave holes
# in 2 % of the person, and hardly any frame has a hull.
_DISC = 0.9
_PIXELS = 3  # along the edge of a voxel
_TOO_WIDE = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
_AT_ONCE = 32  # frames
_SHIFT = 4  # bits of a pixel's fraction


def virtual_recording(
    occupied: Bool[np.ndarray, "frames x y z"],
    origin: Any,
    spacing: float,
    cameras: int = VIRTUAL_CAMERAS,
    skeleton: Skeleton | None = None,
    up: str = "+Z",
    fps: float = 30.0,
    frame_index: Any = None,
) -> Recording:
    """Render voxels into virtual cameras around them.

    The result goes to `reconstruct`, to `write_recording`, or to whatever takes a recording. Bodies that are cut at
    the edge of the volume look whole to virtual cameras: only `reconstruct_hulls` tells them.

    Args:
        occupied: Which voxels are occupied.
        origin: Lower corner of the first voxel, ``(3,)`` (m, world).
        spacing: Edge length of a voxel (m).
        cameras: Number of virtual cameras, at least 3.
        skeleton: The subject's dimensions, if known.
        up: World axis that points up.
        fps: Frames per second.
        frame_index: Number of each frame; by default counted from 0.

    Returns:
        Silhouettes and cameras in the world of the voxels. Frames without voxels are black.

    Raises:
        ValueError: One line that names the argument, or nothing is occupied in any frame.
    """
    check_count("cameras", cameras, MIN_VIEWS)
    return seen_by_virtual_cameras(make_volumes(occupied, origin, spacing, up, fps, frame_index, skeleton), cameras)


def seen_by_virtual_cameras(volumes: Volumes, count: int = VIRTUAL_CAMERAS) -> Recording:
    """As `virtual_recording`, of volumes that are checked.

    Raises:
        ValueError: No voxel is occupied in any frame.
    """
    parts = [np.arange(len(volumes))[start : start + _AT_ONCE] for start in range(0, len(volumes), _AT_ONCE)]
    extents = [(hulls.voxels.min(0), hulls.voxels.max(0) + 1) for hulls in (hulls_of(volumes, p) for p in parts)
               if len(hulls.voxels)]  # fmt: skip
    if not extents:
        raise ValueError(f"occupied: no voxel of {volumes.name} is occupied in any frame; give True for the person")
    grid = upright_grid(volumes)
    lower, upper = np.min([low for low, _ in extents], 0), np.max([high for _, high in extents], 0)
    low, high = (np.asarray(grid.origin) + grid.spacing * each for each in (lower, upper))
    cameras = virtual_cameras(count, low, high, grid.spacing / _PIXELS)
    silhouettes = []
    for part in parts:
        hulls = hulls_of(volumes, part)
        silhouettes += [rendered(hulls.voxels[inside], grid, cameras) for inside in hulls.inside]
    back = rotation_to_z_up(volumes.up).T
    return Recording(
        cameras.rotated(back), np.concatenate(silhouettes), volumes.fps, volumes.up, volumes.frame_index,
        volumes.skeleton, volumes.truth, volumes.name,
    )  # fmt: skip


def rendered(
    voxels: Int[np.ndarray, "voxels 3"], grid: VoxelGrid, cameras: Cameras
) -> UInt8[np.ndarray, "frames=1 cams h w8"]:
    """Silhouettes of the voxels (indices x, y, z) of one frame: a disc for each one at the surface."""
    width, height = cameras.size.max(0).tolist()
    masks = np.zeros((1, len(cameras), height, width), np.uint8)
    points = np.asarray(grid.origin) + grid.spacing * (_surface(voxels) + 0.5)
    for mask, (u, v, radius) in zip(masks[0], _discs(points, grid.spacing, cameras), strict=True):
        for disc in zip(u.tolist(), v.tolist(), radius.tolist(), strict=True):
            cv2.circle(mask, disc[:2], disc[2], 1, cv2.FILLED, shift=_SHIFT)
        cv2.erode(mask, _TOO_WIDE, dst=mask)
    return pack_silhouettes(masks.view(bool))


def _surface(voxels: Int[np.ndarray, "voxels 3"]) -> Int[np.ndarray, "some 3"]:
    """The voxels with an empty neighbour."""
    if len(voxels) == 0:
        return voxels
    lower = voxels.min(0)
    box = np.zeros(voxels.max(0) - lower + 1, bool)
    box[tuple((voxels - lower).T)] = True
    return np.argwhere(observed_edge(box)) + lower


def _discs(points: Float[np.ndarray, "n 3"], spacing: float, cameras: Cameras) -> Any:
    """Middle (u, v) and radius of each voxel's disc in every camera, in fractions of a pixel."""
    u, v, depth = (np.asarray(each) for each in project(cameras, points))
    radius = _DISC * spacing * np.asarray(cameras.K)[:, 0, 0, None] / depth
    return np.round((1 << _SHIFT) * np.stack([u, v, radius], 1)).astype(int)
