"""A grid of a fixed size that goes with the person, so that compiled shapes never change."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from .._runtime.steps import Steps, finished
from ..hull import VoxelGrid
from ._prepare import changing_grid
from ._prepared import Prepared
from ._settings import Settings

# Extent of the grid (m): a person with the arms out, and the way that the middle may go before limbs come to its edge.
_EXTENT = np.array([2.5, 2.5, 2.7])
_FAR = np.array([0.3, 0.3, 0.4])
# Grids begin at multiples of this many voxels, so that two of them share their voxels where they overlap.
_STEP = 4
# Shares of that way: where the next grid is begun, and the farthest that a person may be off while no frame is carved.
_BEGIN, _AT_MOST = 0.5, 2.0


def grid_around(middle: Float[np.ndarray, "3"], spacing: float) -> VoxelGrid:
    """The grid around the middle of a person (m, in a world with z up) with voxels of an edge (m)."""
    step = _STEP * spacing
    shape = _STEP * np.ceil(_EXTENT / step).astype(int)
    x, y, z = shape.tolist()
    origin = step * np.round((middle - spacing * shape / 2) / step)
    return VoxelGrid(origin=origin, spacing=float(spacing), shape=(x, y, z))


def way_off(grid: VoxelGrid, middle: Float[np.ndarray, "3"]) -> float:
    """How far the middle of a person (m) is from that of the grid; from 1 on, limbs may come to the grid's edge."""
    centre = (np.asarray(grid.origin) + grid.upper) / 2
    return float((np.abs(middle - centre) / _FAR).max())


class MovingGrid:
    """Moves the grid of a stream: with steps in successive frames, because a move takes as long as three frames.

    Args:
        settings: How to reconstruct.
    """

    def __init__(self, settings: Settings):
        self._settings = settings
        self._steps: Steps[Prepared] | None = None
        self._next: VoxelGrid | None = None

    def stay(self) -> None:
        """Give up a move that has begun, because what is known of the cameras or of the subject has changed."""
        self._steps = None

    def followed(self, prepared: Prepared, middle: Float[np.ndarray, "3"], carved: bool) -> Prepared:
        """What is prepared, with a grid for the person whose middle is given (m, z up), if that is another one.

        Args:
            prepared: For the frames before, with a grid.
            middle: Of the person in this frame or the one before.
            carved: Whether this frame is carved, so that limbs must be inside of the grid.
        """
        assert prepared.table is not None
        old = prepared.table.grid
        off = way_off(old, middle)
        if self._next is not None and way_off(self._next, middle) > 1:
            self.stay()  # the person has gone elsewhere
        if self._steps is None:
            if off <= _BEGIN:
                return prepared
            self._next = grid_around(middle, self._settings.hull.spacing)
            self._steps = changing_grid(prepared, self._next, prepared.table.size, self._settings)
        if off > (1 if carved else _AT_MOST):
            return self._taken(prepared, finished(self._steps))
        try:
            for _ in range(_steps_at_once(old)):
                next(self._steps)
        except StopIteration as end:
            return self._taken(prepared, end.value)
        return prepared

    def _taken(self, prepared: Prepared, moved: Prepared) -> Prepared:
        self.stay()
        return replace(prepared, table=moved.table, edge=moved.edge)


def _steps_at_once(grid: VoxelGrid) -> int:
    """How many steps of 0.5 to 2 ms to take with each frame, so that a move is made in about seven."""
    return 4 + 2 * (grid.size // 1_000_000)
