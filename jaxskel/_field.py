"""What a hull says to a body with volume: signed distances to its surface, and points on that surface."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy import ndimage

from ._hull import VisualHulls

# Fixed for all frames of all recordings, so that nothing compiles twice: 2.4 m hold a person in any pose.
_CELLS = 80
_CELL_SPACING = 0.03
_MARGIN = 10  # voxels around the hull for which distances are computed


class DistanceField(eqx.Module):
    """Signed distance to the surface of a hull on a regular grid: negative inside."""

    values: Float[Array | np.ndarray, "*frames x y z"]
    """Distances (m)."""
    origin: Float[Array | np.ndarray, "*frames 3"]
    """Where the first value stands in the world (m)."""
    spacing: Float[Array | np.ndarray, "*frames"]
    """Distance of neighbouring values (m)."""

    def at(self, points: Float[Array, "*points 3"]) -> Float[Array, "*points"]:
        """Interpolate the distances of one frame trilinearly; outside of the grid, from its nearest point."""
        shape = np.array(self.values.shape)
        place = (points.reshape(-1, 3) - jnp.asarray(self.origin)[None]) / self.spacing
        place = jnp.clip(place, 0.0, (shape - 1.001)[None])
        low = jnp.floor(place).astype(jnp.int32)
        x, y, z = jnp.moveaxis(place - low, -1, 0)
        first = (low[..., 0] * shape[1] + low[..., 1]) * shape[2] + low[..., 2]
        flat = jnp.asarray(self.values).reshape(-1)

        def corner(i: int, j: int, k: int) -> Array:
            return flat.at[first + int((i * shape[1] + j) * shape[2] + k)].get(mode="promise_in_bounds")

        def along_z(i: int, j: int) -> Array:
            return corner(i, j, 0) * (1 - z) + corner(i, j, 1) * z

        def along_y(i: int) -> Array:
            return along_z(i, 0) * (1 - y) + along_z(i, 1) * y

        return (along_y(0) * (1 - x) + along_y(1) * x).reshape(points.shape[:-1])


def hull_volume(
    hulls: VisualHulls, frame: int, count: int = 768
) -> tuple[DistanceField, Float[np.ndarray, "points 3"]]:
    """Signed distance field of one hull and points spread evenly over its surface.

    The surface runs between the centres of occupied and empty voxels: distances are exact to half a voxel. Points
    are boundary voxels moved 0.4 voxels outwards, drawn without order but always the same.

    Args:
        hulls: Hulls; the one of this frame must not be empty.
        frame: Which of them.
        count: Number of surface points; where the hull has fewer boundary voxels, some are given twice.
    """
    voxels = hulls.voxels[hulls.inside[frame]]
    if len(voxels) == 0:
        raise ValueError(f"hull_volume: the hull of frame {frame} is empty")
    spacing = hulls.grid.spacing
    low = voxels.min(0) - _MARGIN
    occupied = np.zeros(voxels.max(0) - low + _MARGIN + 1, bool)
    occupied[tuple((voxels - low).T)] = True
    outside = np.asarray(ndimage.distance_transform_edt(~occupied))
    inside = np.asarray(ndimage.distance_transform_edt(occupied))
    signed = spacing * (outside - inside + np.where(occupied, 0.5, -0.5))
    first = np.asarray(hulls.grid.origin) + spacing * (low + 0.5)

    boundary = np.argwhere(occupied & ~np.asarray(ndimage.binary_erosion(occupied), bool))
    chosen = np.random.default_rng(0).permutation(len(boundary))
    boundary = boundary[np.resize(chosen, count)]
    normals = np.stack([np.gradient(signed, axis=axis)[tuple(boundary.T)] for axis in range(3)], -1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    surface = first + spacing * (boundary + 0.4 * normals)

    # Around the middle of the hull, so that the grid's fixed size does not cut a stretched limb.
    middle = first + spacing * (np.array(occupied.shape) - 1) / 2
    origin = middle - _CELL_SPACING * (_CELLS - 1) / 2
    axes = [(origin[k] + _CELL_SPACING * np.arange(_CELLS) - first[k]) / spacing for k in range(3)]
    values = ndimage.map_coordinates(
        signed.astype(np.float32), np.meshgrid(*axes, indexing="ij"), order=1, mode="nearest"
    )
    field = DistanceField(values, origin.astype(np.float32), np.array(_CELL_SPACING, np.float32))
    return field, surface.astype(np.float32)
