"""A grid of a fixed size that goes with the person, so that compiled shapes never change."""

import numpy as np
from jaxtyping import Float

from ..hull import VoxelGrid

# Extent of the grid (m): a person with the arms out, and the way that the middle may go before the grid follows.
_EXTENT = np.array([2.5, 2.5, 2.7])
_FAR = np.array([0.3, 0.3, 0.4])
# Grids begin at multiples of this many voxels, so that two of them share their voxels where they overlap.
_STEP = 4


def grid_around(middle: Float[np.ndarray, "3"], spacing: float) -> VoxelGrid:
    """The grid around the middle of a person (m, in a world with z up) with voxels of an edge (m)."""
    step = _STEP * spacing
    shape = _STEP * np.ceil(_EXTENT / step).astype(int)
    x, y, z = shape.tolist()
    origin = step * np.round((middle - spacing * shape / 2) / step)
    return VoxelGrid(origin=origin, spacing=float(spacing), shape=(x, y, z))


def is_left(grid: VoxelGrid, middle: Float[np.ndarray, "3"]) -> bool:
    """Whether the middle of the person (m) is so far from that of the grid that limbs may come to its edge."""
    centre = (np.asarray(grid.origin) + grid.upper) / 2
    return bool((np.abs(middle - centre) > _FAR).any())
