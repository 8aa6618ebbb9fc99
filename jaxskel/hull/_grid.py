"""The voxel grid: position, spacing and shape of the carved volume."""

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Real

# A grid of more voxels than this would need gigabytes for its projection table.
MAX_VOXELS = 60_000_000


class VoxelGrid(eqx.Module):
    """An axis-aligned grid of cubic voxels.

    Attributes:
        origin: Lower corner of the first voxel in the world (m).
        spacing: Edge length of a voxel (m).
        shape: Number of voxels along x, y and z.
    """

    origin: Float[Array | np.ndarray, "3"]
    spacing: float
    shape: tuple[int, int, int] = eqx.field(static=True)

    @property
    def size(self) -> int:
        """Number of voxels."""
        return int(np.prod(self.shape))

    @property
    def upper(self) -> Float[np.ndarray, "3"]:
        """Upper corner of the last voxel in the world (m)."""
        return np.asarray(self.origin) + np.array(self.shape) * self.spacing

    def axes(self) -> tuple[Float[np.ndarray, " x"], Float[np.ndarray, " y"], Float[np.ndarray, " z"]]:
        """Coordinates of the voxel centres along x, y and z (m)."""
        x, y, z = (
            float(low) + self.spacing * (np.arange(n) + 0.5)
            for low, n in zip(np.asarray(self.origin), self.shape, strict=True)
        )
        return x, y, z

    def centres(self) -> Float[np.ndarray, "voxels 3"]:
        """Voxel centres in the world (m), the last axis fastest."""
        return np.stack(np.meshgrid(*self.axes(), indexing="ij"), -1).reshape(-1, 3)


def check_spacing(spacing: float) -> None:
    """Refuse an edge length (m) that no voxel can have: millimetres are a common mistake.

    Raises:
        ValueError: It is not between 1 mm and 1 m.
    """
    if isinstance(spacing, bool) or not isinstance(spacing, int | float | np.number) or not 1e-3 <= spacing <= 1.0:
        raise ValueError(f"voxel spacing {spacing} m: give metres between 0.001 and 1, 0.015 is the usual choice")


def make_grid(lower: Real[np.ndarray, "3"], upper: Real[np.ndarray, "3"], spacing: float) -> VoxelGrid:
    """Make the smallest grid that covers a box, with its origin at even multiples of the spacing.

    All grids of a spacing are therefore aligned with each other, and so are pairs of their voxels.

    Args:
        lower: Lower corner of the box in the world (m).
        upper: Upper corner of the box in the world (m).
        spacing: Edge length of a voxel (m).

    Raises:
        ValueError: The spacing is out of range, the box is empty or not finite, or the grid does not fit into memory.
    """
    lower, upper = np.asarray(lower, np.float64), np.asarray(upper, np.float64)
    check_spacing(spacing)
    if not (np.isfinite(lower).all() and np.isfinite(upper).all() and (upper > lower).all()):
        raise ValueError(f"the box from {lower} to {upper} is empty or not finite")
    first = 2 * np.floor(lower / (2 * spacing) + 1e-9)
    cells = np.maximum(np.ceil(upper / spacing - 1e-9) - first, 1)
    if np.prod(cells) > MAX_VOXELS:
        raise ValueError(
            f"a grid of {np.prod(cells) / 1e6:.0f} million voxels of {1e3 * spacing:.0f} mm is needed to cover "
            f"{np.round(upper - lower, 2)} m: take a coarser spacing or give a smaller box"
        )
    x, y, z = (int(c) for c in cells)
    return VoxelGrid(origin=first * spacing, spacing=float(spacing), shape=(x, y, z))
