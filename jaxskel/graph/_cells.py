"""Hulls as cells of 2 x 2 x 2 voxels; all voxels of a cell are neighbours, so each cell is connected.

A cell is a byte, one bit per voxel. Two neighbouring cells are connected if both have voxels where they touch: across a
face any of four with any of four, across an edge any of two with any of two, across a corner one with one. So cells are
connected exactly as their voxels are (26-neighbourhood), and there are a sixth as many of them.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

from ..hull import VisualHulls

_CORNERS = np.array(list(np.ndindex(2, 2, 2)))
_AROUND = np.array([way for way in np.ndindex(3, 3, 3) if way != (1, 1, 1)]) - 1
WAYS = len(_AROUND)
"""Number of neighbours of a cell. Opposite directions have mirrored indices: the first and the last, and so on."""


def _touching(way: np.ndarray) -> int:
    """The voxels of a cell that touch its neighbour in direction `way`, as bits."""
    beside = ((way <= 0) | (_CORNERS == 1)) & ((way >= 0) | (_CORNERS == 0))
    return int((beside.all(1) << np.arange(8)).sum())


HERE = np.array([_touching(way) for way in _AROUND], np.uint8)
"""For each direction, the voxels of a cell that touch its neighbour there, as bits."""
THERE = np.array([_touching(-way) for way in _AROUND], np.uint8)
"""For each direction, the voxels of that neighbour that touch this cell, as bits."""

# For each byte: number of voxels, their lower and upper bounds, and the mean of their centres (voxels).
_HELD = (np.arange(256)[:, None] >> np.arange(8)) % 2 == 1
_COUNT = _HELD.sum(1)
_LOW = np.where(_HELD[..., None], _CORNERS, 2).min(1)
_HIGH = np.where(_HELD[..., None], _CORNERS + 1, 0).max(1)
_MIDDLE = _HELD @ _CORNERS / np.maximum(_COUNT, 1)[:, None] + 0.5
_BITS = 2.0 ** np.arange(8)


@dataclass(frozen=True, eq=False)
class Cells:
    """The cells of some frames: a box with an empty margin for each frame, all of the same size, one after the other.

    A neighbour is therefore at a constant index offset.

    Attributes:
        codes: Occupied voxels of each cell, as bits.
        steps: Index offset of the neighbour in each direction.
        rows: Lower corner of each row of cells along z, in the world (m).
        depth: Number of cells per row.
        spacing: Edge of a voxel (m).
        tables: For each byte, relative to the cell's corner: lower bounds, upper bounds and mean centre of its voxels
            (m).
    """

    codes: UInt8[np.ndarray, " cells"]
    steps: Int[np.ndarray, " ways"]
    rows: Float[np.ndarray, "rows 3"]
    depth: int
    spacing: float
    tables: tuple[Float[np.ndarray, "codes 3"], Float[np.ndarray, "codes 3"], Float[np.ndarray, "codes 3"]]

    def middles(self, some: Int[np.ndarray, " some"]) -> Float[np.ndarray, "some 3"]:
        """Mean of the voxel centres of some cells, in the world (m)."""
        corners = self._corners(some)
        corners += self.tables[2].take(self.codes.take(some), 0)
        return corners

    def measured(self, some: Int[np.ndarray, " some"]) -> tuple[Int[np.ndarray, " some"], list[np.ndarray]]:
        """Number of voxels of some cells, and the positions of `tables` in the world (m)."""
        corners, codes = self._corners(some), self.codes.take(some)
        return _COUNT.take(codes), [corners + table.take(codes, 0) for table in self.tables]

    def _corners(self, some: Int[np.ndarray, " some"]) -> Float[np.ndarray, "some 3"]:
        row = some // self.depth
        corners = self.rows.take(row, 0)
        corners[:, 2] += 2 * self.spacing * (some - row * self.depth)
        return corners


def cells_of(hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> tuple[Cells, Int[np.ndarray, " frames"]]:
    """Group the voxels of some hulls, none of them empty, into cells.

    Cells begin at even grid indices, so that the cells of a person at rest stay the same.

    Args:
        hulls: Hulls of some frames.
        roots: For each frame the index into ``hulls.voxels`` of its root.

    Returns:
        The cells, and the index of each root's cell.
    """
    axes = np.ascontiguousarray(hulls.voxels.T)
    own = [axes.take(inside.nonzero()[0], 1) for inside in hulls.inside]
    low = (np.array([voxels.min(1) for voxels in own], np.int64) >> 1) - 1
    high = (np.array([voxels.max(1) for voxels in own], np.int64) >> 1) + 2
    shape: list[int] = (high - low).max(0).tolist()
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    codes = np.empty((len(hulls), shape[0] * shape[1] * shape[2]), np.uint8)
    for box, (x, y, z), (x0, y0, z0) in zip(codes, own, low.tolist(), strict=True):
        bits = _BITS.take((x & 1) << 2 | (y & 1) << 1 | z & 1)
        places = (((x >> 1) - x0) * shape[1] + ((y >> 1) - y0)) * shape[2] + ((z >> 1) - z0)
        box[:] = np.bincount(places, bits, len(box))
    at_roots = ((hulls.voxels[roots] >> 1) - low) @ strides + np.arange(len(hulls)) * codes.shape[1]
    spacing = hulls.grid.spacing
    columns = np.indices((shape[0], shape[1], 1)).reshape(3, -1).T
    rows = (np.asarray(hulls.grid.origin) + 2 * spacing * (low[:, None] + columns)).reshape(-1, 3)
    tables = spacing * _LOW, spacing * _HIGH, spacing * _MIDDLE
    return Cells(codes.reshape(-1), _AROUND @ strides, rows, shape[2], spacing, tables), at_roots
