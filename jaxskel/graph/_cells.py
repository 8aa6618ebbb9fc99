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


_BYTES = np.arange(256)[:, None]
_HERE = np.array([_touching(way) for way in _AROUND])
_THERE = np.array([_touching(-way) for way in _AROUND])
TOUCHED = np.where(_BYTES & _HERE, _THERE, 0).astype(np.uint8)
"""For each byte and direction, the voxels of the neighbour there that touch a cell with this byte, as bits."""

# For each byte: number of voxels, their lower and upper bounds, and the mean of their centres (voxels).
_HELD = (_BYTES >> np.arange(8)) % 2 == 1
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
        tables: For each byte: mean centre of its voxels, relative to the cell's corner; from there, the way to their
            lower bounds, turned round, and to their upper bounds (m).
    """

    codes: UInt8[np.ndarray, " cells"]
    steps: Int[np.ndarray, " ways"]
    rows: Float[np.ndarray, "rows 3"]
    depth: int
    spacing: float
    tables: tuple[Float[np.ndarray, "codes 3"], Float[np.ndarray, "codes 6"]]

    def middles(self, some: Int[np.ndarray, " some"]) -> Float[np.ndarray, "some 3"]:
        """Mean of the voxel centres of some cells, in the world (m)."""
        row = some // self.depth
        middles = self.rows.take(row, 0)
        row *= -self.depth
        row += some
        middles[:, 2] += row * (2 * self.spacing)
        middles += self.tables[0].take(self.codes.take(some), 0)
        return middles

    def counts(self, some: Int[np.ndarray, " some"]) -> Int[np.ndarray, " some"]:
        """Number of voxels of some cells."""
        return _COUNT.take(self.codes.take(some))

    def bounds(
        self, some: Int[np.ndarray, " some"], middles: Float[np.ndarray, "some 3"]
    ) -> Float[np.ndarray, "some 6"]:
        """Lower bounds of some cells' voxels, as negative numbers, then upper bounds (m), from the cells' `middles`."""
        bounds = self.tables[1].take(self.codes.take(some), 0)
        bounds[:, :3] -= middles
        bounds[:, 3:] += middles
        return bounds


def cells_of(hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> tuple[Cells, Int[np.ndarray, " frames"]]:
    """Group the voxels of some hulls, none of them empty, into cells.

    Cells begin at even grid indices, so that the cells of a person at rest stay the same.

    Args:
        hulls: Hulls of some frames.
        roots: For each frame the index into ``hulls.voxels`` of its root.

    Returns:
        The cells, and the index of each root's cell.
    """
    runs = [hulls.runs.of(f) for f in range(len(hulls))]
    axes = [axis >> 1 for axis in np.ascontiguousarray(hulls.voxels.T)]
    low = np.array([[axis.take(own.first).min() for axis in axes] for own in runs], np.int64) - 1
    high = np.array([[axis.take(own.last).max() for axis in axes] for own in runs], np.int64) + 2
    shape: list[int] = (high - low).max(0).tolist()
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    starts = low @ strides
    places = axes[0] * strides[0] + axes[1] * strides[1] + axes[2]
    x, y, z = (hulls.voxels & 1).T
    bits = _BITS.take(x << 2 | y << 1 | z)
    codes = np.empty((len(hulls), shape[0] * shape[1] * shape[2]), np.uint8)
    for box, own, start in zip(codes, runs, starts.tolist(), strict=True):
        some = own.voxels
        box[:] = np.bincount(places.take(some) - start, bits.take(some), len(box))
    at_roots = places[roots] - starts + np.arange(len(hulls)) * codes.shape[1]
    spacing = hulls.grid.spacing
    columns = np.indices((shape[0], shape[1], 1)).reshape(3, -1).T
    rows = (np.asarray(hulls.grid.origin) + 2 * spacing * (low[:, None] + columns)).reshape(-1, 3)
    tables = spacing * _MIDDLE, spacing * np.concatenate([_MIDDLE - _LOW, _HIGH - _MIDDLE], 1)
    return Cells(codes.reshape(-1), _AROUND @ strides, rows, shape[2], spacing, tables), at_roots
