"""What a hull says to a body with volume: signed distances to its surface, and points on that surface."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ._distance_transform import signed_distances
from ._visual_hulls import VisualHulls

# Fixed for all frames of all recordings, so that nothing compiles twice: 2.4 m hold a person in any pose.
_CELLS = 80
_CELL_SPACING = 0.03
# Up to this far from the surface (m) distances are exact: a pose that is farther off is not a matter of millimetres.
_EXACT = 0.2
# The normal looks at voxels within this many voxels: enough to smooth the stairs, less than the radius of a forearm
# at the usual spacing.
_REACH = 2
_BALL = np.array([o for o in np.ndindex((2 * _REACH + 1,) * 3) if 0 < ((np.array(o) - _REACH) ** 2).sum() < 7]) - _REACH


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
    hulls: VisualHulls, frame: int, count: int = 1200
) -> tuple[DistanceField, Float[np.ndarray, "points 3"]]:
    """Signed distance field of one hull and points spread evenly over its surface.

    The surface runs between the centres of occupied and empty voxels: distances are exact to half a voxel inside and
    up to 0.2 m outside; farther away they are right to some percent. Points are boundary voxels moved 0.4 voxels
    outwards, drawn without order but always the same.

    Args:
        hulls: Hulls; the one of this frame must not be empty.
        frame: Which of them.
        count: Number of surface points; where the hull has fewer boundary voxels, some are given twice.

    Returns:
        The field, and the points, both in the hulls' world (m).

    Raises:
        ValueError: The hull is empty.
    """
    values, origin, surface = _volume(hulls, frame, count)
    return DistanceField(values, origin, np.array(_CELL_SPACING, np.float32)), surface


def hull_volumes(
    hulls: VisualHulls, frames: Int[np.ndarray, " frames"] | None = None, count: int = 1200
) -> tuple[DistanceField, Float[np.ndarray, "frames points 3"]]:
    """`hull_volume` of several frames, one after the other: fields and points have a leading axis of frames.

    Args:
        hulls: Hulls.
        frames: Which of them; by default all. None of these hulls may be empty.
        count: Number of surface points of each frame.

    Returns:
        The fields, and the points, in the hulls' world (m).

    Raises:
        ValueError: A hull is empty.
    """
    chosen = np.arange(len(hulls)) if frames is None else frames
    field = DistanceField(
        np.empty((len(chosen), _CELLS, _CELLS, _CELLS), np.float32),
        np.empty((len(chosen), 3), np.float32),
        np.full(len(chosen), _CELL_SPACING, np.float32),
    )
    surface = np.empty((len(chosen), count, 3), np.float32)
    for i, frame in enumerate(chosen):
        field.values[i], field.origin[i], surface[i] = _volume(hulls, int(frame), count)
    return field, surface


def _volume(hulls: VisualHulls, frame: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values and origin of the field, surface points; all is computed in voxels from the corner of the hull's box."""
    own = np.flatnonzero(hulls.inside[frame])
    if len(own) == 0:
        raise ValueError(f"hull_volume: the hull of frame {frame} is empty; leave out frames without a person")
    spacing = hulls.grid.spacing
    voxels = [hulls.voxels[own, axis] for axis in range(3)]  # many times faster to work on than rows of three
    low = np.array([line.min() for line in voxels])
    shape = np.array([line.max() for line in voxels]) - low + 1
    sides = shape + 2 * _REACH
    padded = np.zeros(sides, bool)
    steps = np.array([sides[1] * sides[2], sides[2], 1])
    first = (low - _REACH) @ steps
    padded.reshape(-1)[voxels[0] * steps[0] + voxels[1] * steps[1] + voxels[2] - first] = True
    occupied = padded[(slice(_REACH, -_REACH),) * 3]
    boundary = np.flatnonzero(occupied & ~_all_neighbours(padded))
    boundary = np.stack(np.unravel_index(boundary, occupied.shape), -1)

    # Around the middle of the hull, so that the grid's fixed size does not cut a stretched limb; from the centre of a
    # voxel, so that values stand where the voxels do when their spacing divides that of the values.
    first = np.rint((shape - 1) / 2 - (_CELLS - 1) / 2 * _CELL_SPACING / spacing).astype(int)
    values = signed_distances(occupied, boundary, first, _CELL_SPACING / spacing, _CELLS, _EXACT / spacing)
    values *= np.float32(spacing)
    corner = np.asarray(hulls.grid.origin) + spacing * (low + 0.5)

    points = boundary[np.resize(np.random.default_rng(0).permutation(len(boundary))[:count], count)]
    points = points + 0.4 * _normals(padded, (points + _REACH) @ steps, steps)
    return values, (corner + spacing * first).astype(np.float32), (corner + spacing * points).astype(np.float32)


def _all_neighbours(padded: np.ndarray) -> Bool[np.ndarray, "x y z"]:
    """Whether all six neighbours of a voxel are occupied, without the padding."""
    inner, before, after = (slice(_REACH + i, i - _REACH or None) for i in (0, -1, 1))
    return (
        padded[before, inner, inner] & padded[after, inner, inner]
        & padded[inner, before, inner] & padded[inner, after, inner]
        & padded[inner, inner, before] & padded[inner, inner, after]
    )  # fmt: skip


def _normals(padded: np.ndarray, places: np.ndarray, steps: np.ndarray) -> Float[np.ndarray, "points 3"]:
    """Away from the centroid of what is occupied around a voxel; zero where a hull is thinner than its surface."""
    around = padded.reshape(-1)[places[:, None] + (_BALL @ steps)[None]]
    normals = -(around.astype(np.float32) @ _BALL.astype(np.float32))
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
