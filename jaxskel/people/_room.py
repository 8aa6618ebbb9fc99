"""The room in which several people are: a coarse voxel grid around all of them, projected into the cameras."""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

from ..cameras import Cameras
from ..hull import ProjectionTable, bodies_among, carve, judge_misses, make_grid, projection_table
from ..recording import MIN_VIEWS, Recording, find_empty_views, rotation_to_z_up, silhouette_areas

SPACING = 0.05
"""Edge of a voxel (m): enough to tell bodies apart, and a person still has about a thousand voxels."""
_FRAMES = 48  # evenly spread, to find where people are
_FIRST = 80  # voxels along the edge of the volume that is carved to find where people are
_LEAST = 0.01  # bodies that are smaller there are noise (m^3)
_FARTHEST = 8.0  # from where the cameras look (m)


class Room(eqx.Module):
    """The room of a recording.

    Attributes:
        cameras: The rig in the world with z up.
        table: Projection of a coarse grid around everybody; None where no frame shows anybody.
        max_misses: Cameras that may see background at an occupied voxel.
        empty_views: Views that show nobody.
    """

    cameras: Cameras
    table: ProjectionTable | None
    max_misses: int
    empty_views: Bool[np.ndarray, "frames cams"]


def make_room(recording: Recording) -> Room:
    """Find the part of the room in which people are, from frames spread over the recording."""
    cameras = recording.cameras.rotated(rotation_to_z_up(recording.up))
    empty_views = find_empty_views(silhouette_areas(recording.silhouettes), cameras)
    usable = np.flatnonzero((~empty_views).sum(1) >= MIN_VIEWS)
    nothing = Room(cameras, None, 0, empty_views)
    if len(usable) == 0:
        return nothing
    chosen = usable[np.unique(np.linspace(0, len(usable) - 1, _FRAMES).astype(int))]
    silhouettes, gone = recording.silhouettes[chosen], empty_views[chosen]
    size = silhouettes.shape[2], 8 * silhouettes.shape[3]
    views = min(MIN_VIEWS, len(cameras))
    middle, reach = _looked_at(cameras)
    first = make_grid(middle - reach, middle + reach, max(SPACING, 2 * reach / _FIRST))
    hulls = carve(silhouettes, projection_table(cameras, first, *size, views), gone)
    bodies = bodies_among(hulls.voxels, first)
    voxels = hulls.voxels[bodies.sizes[bodies.voxels_of(0)] * first.spacing**3 >= _LEAST]
    if len(voxels) == 0:
        return nothing
    corners = np.asarray(first.origin) + first.spacing * np.stack([voxels.min(0) - 2, voxels.max(0) + 3])
    misses = judge_misses(cameras, silhouettes, gone, views, corners)
    grid = make_grid(corners[0], corners[1], SPACING)
    return Room(cameras, projection_table(cameras, grid, *size, views + misses), misses, empty_views)


def _looked_at(cameras: Cameras) -> tuple[Float[np.ndarray, "3"], float]:
    """The point nearest to the optical axes of all cameras, and how far from it people may be (m)."""
    axes, centres = np.asarray(cameras.R)[:, 2], cameras.centres
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    middle = np.linalg.lstsq(across.sum(0), np.einsum("cij,cj->i", across, centres), rcond=None)[0]
    return middle, min(_FARTHEST, float(np.linalg.norm(centres - middle, axis=1).max()))
