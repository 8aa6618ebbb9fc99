"""Visual hulls of a batch of frames, stored sparsely: the interface between carving (JAX) and graph (NumPy)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jax.tree_util import register_dataclass
from jaxtyping import Bool, Float, Int

from ._grid import VoxelGrid, check_spacing
from ._runs import Runs, runs_of


@register_dataclass
@dataclass(frozen=True, eq=False)
class VisualHulls:
    """Occupied voxels of a batch of frames. Voxels that are empty in every frame are not stored.

    Attributes:
        voxels: Grid indices (x, y, z) of every voxel that is occupied in some frame, in grid order.
        inside: Whether a voxel is occupied in a frame.
    """

    voxels: Int[np.ndarray, "voxels 3"]
    inside: Bool[np.ndarray, "frames voxels"]
    grid: VoxelGrid

    def __len__(self) -> int:
        return len(self.inside)

    @property
    def centres(self) -> Float[np.ndarray, "voxels 3"]:
        """Voxel centres in the world (m)."""
        return np.asarray(self.grid.origin) + self.grid.spacing * (self.voxels + 0.5)

    @property
    def volumes(self) -> Float[np.ndarray, " frames"]:
        """Volume of each hull (m^3)."""
        return self.inside.sum(1) * self.grid.spacing**3

    def __getitem__(self, frames: Int[np.ndarray, " some"] | Bool[np.ndarray, " frames"] | slice) -> "VisualHulls":
        """The hulls of some frames."""
        if "runs" not in vars(self):
            return VisualHulls(self.voxels, self.inside[frames], self.grid)
        return self._with(self.inside[frames], self.runs.of_frames(np.arange(len(self))[frames]))

    @cached_property
    def runs(self) -> Runs:
        """Vertical runs of the occupied voxels."""
        return runs_of(self.voxels, self.inside)

    def occupied(self, frame: int | np.integer) -> Int[np.ndarray, " own"]:
        """Indices into `voxels` of the occupied voxels of a frame, ascending."""
        return self.runs.of(frame).voxels

    def only(self, some: Bool[np.ndarray, " runs"]) -> "VisualHulls":
        """The same hulls with some of their runs only."""
        inside = self.inside.copy()
        # Clear the others, which are mostly specks of few voxels.
        others = self.runs.chosen(~some)
        inside[others.frame.repeat(others.length), others.voxels] = False
        return self._with(inside, self.runs.chosen(some))

    def _with(self, inside: Bool[np.ndarray, "frames voxels"], runs: Runs) -> "VisualHulls":
        """Other occupied voxels, whose runs are known."""
        hulls = VisualHulls(self.voxels, inside, self.grid)
        vars(hulls)["runs"] = runs  # where `cached_property` keeps them
        return hulls

    def dense(self, frame: int) -> Bool[np.ndarray, "x y z"]:
        """Occupancy of one frame on the whole grid."""
        occupancy = np.zeros(self.grid.shape, bool)
        occupancy[tuple(self.voxels[self.inside[frame]].T)] = True
        return occupancy


def hulls_from_dense(occupancy: Bool[np.ndarray, "frames x y z"], grid: VoxelGrid) -> VisualHulls:
    """Store dense occupancy, one volume per frame, as `VisualHulls`.

    Raises:
        ValueError: The volumes do not have the grid's shape, or its spacing is not in metres.
    """
    if occupancy.ndim != 4 or occupancy.shape[1:] != grid.shape:
        raise ValueError(f"occupancy: has shape {occupancy.shape}; give (frames, {', '.join(map(str, grid.shape))})")
    check_spacing(grid.spacing)
    voxels = np.argwhere(occupancy.any(0)).astype(np.int32)
    return VisualHulls(voxels, occupancy[:, voxels[:, 0], voxels[:, 1], voxels[:, 2]], grid)
