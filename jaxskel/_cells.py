"""Hulls by cells of 2 x 2 x 2 voxels, of which any two are neighbours: what a cell holds is connected.

A cell is a byte, one bit a voxel. Two cells beside each other are connected if both have voxels where they touch:
over a face any of four meet any of four, over an edge any two of two, over a corner one meets one. So cells are
connected exactly as their voxels are, and there are a sixth as many of them.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

from ._hull import VisualHulls

_CORNERS = np.array(list(np.ndindex(2, 2, 2)))
_AROUND = np.array([way for way in np.ndindex(3, 3, 3) if way != (1, 1, 1)]) - 1
WAYS = len(_AROUND)
"""Number of cells around a cell. Of two opposite ways one stands as far from the first as the other from the last."""


def _touching(way: np.ndarray) -> int:
    """The voxels of a cell that touch the cell on a way, as bits."""
    beside = ((way <= 0) | (_CORNERS == 1)) & ((way >= 0) | (_CORNERS == 0))
    return int((beside.all(1) << np.arange(8)).sum())


_HERE = np.array([_touching(way) for way in _AROUND], np.uint8)
_THERE = np.array([_touching(-way) for way in _AROUND], np.uint8)

# By byte: how many voxels, where their centres are in the mean, and from where to where they reach (voxels).
_HELD = (np.arange(256)[:, None] >> np.arange(8)) % 2 == 1
_COUNT = _HELD.sum(1)
_MIDDLE = _HELD @ _CORNERS / np.maximum(_COUNT, 1)[:, None] + 0.5
_LOW = np.where(_HELD[..., None], _CORNERS, 2).min(1)
_HIGH = np.where(_HELD[..., None], _CORNERS + 1, 0).max(1)
_EXTENT = np.stack([_LOW, _HIGH])
_BITS = 2.0 ** np.arange(8)

# Cells whose surroundings are looked at at once: what is written stays in the processor's cache until it is read.
_AT_ONCE = 2048


@dataclass(frozen=True)
class Cells:
    """Cells of some frames with a voxel in them, by frame, then in the grid's order; before them one that is empty."""

    codes: UInt8[np.ndarray, " cells"]
    """The voxels of each cell, as bits."""
    corners: Float[np.ndarray, "cells 3"]
    """Least x, y, z of each cell (m)."""
    middles: Float[np.ndarray, "cells 3"]
    """Mean of the centres of each cell's voxels (m)."""
    beside: Int[np.ndarray, "cells ways"]
    """The cells around each one that are connected to it; where there is none, the empty one, 0."""
    of_roots: Int[np.ndarray, " frames"]
    """The cell of each frame's root."""
    spacing: float
    """Edge of a voxel (m)."""

    def counts(self, some: Int[np.ndarray, " some"]) -> Int[np.ndarray, " some"]:
        """Number of voxels of some cells."""
        return _COUNT.take(self.codes.take(some))

    def extents(self, some: Int[np.ndarray, " some"]) -> Float[np.ndarray, "2 some 3"]:
        """Least and greatest x, y, z of the voxels of some cells (m)."""
        return self.corners.take(some, 0) + self.spacing * _EXTENT.take(self.codes.take(some), 1)


def cells_of(hulls: VisualHulls, roots: Int[np.ndarray, " frames"]) -> Cells:
    """Put the voxels of some hulls, none of them empty, into cells.

    Cells stand where the grid's even voxels are, so that those of a person at rest stay the same.

    Args:
        hulls: The hulls.
        roots: For each frame the index into ``hulls.voxels`` of its root.
    """
    own = [np.ascontiguousarray(hulls.voxels.take(inside.nonzero()[0], 0).T) for inside in hulls.inside]
    # Each frame has a box of its own with an empty margin, all of the same size: a neighbour is a constant away.
    low = (np.array([voxels.min(1) for voxels in own], np.int64) >> 1) - 1
    high = (np.array([voxels.max(1) for voxels in own], np.int64) >> 1) + 2
    shape: list[int] = (high - low).max(0).tolist()
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    boxes = np.empty((len(hulls), shape[0] * strides[0]), np.uint8)
    for box, (x, y, z), (x0, y0, z0) in zip(boxes, own, low.tolist(), strict=True):
        bits = _BITS.take((x & 1) << 2 | (y & 1) << 1 | z & 1)
        places = (((x >> 1) - x0) * shape[1] + ((y >> 1) - y0)) * shape[2] + ((z >> 1) - z0)
        box[:] = np.bincount(places, bits, len(box))
    dense = boxes.reshape(-1)
    cells = np.concatenate([[0], (dense != 0).nonzero()[0]])
    numbers = np.zeros(len(dense), np.int32)
    numbers[cells] = np.arange(len(cells))
    codes = dense.take(cells)
    corners = _corners(hulls, low, shape, cells)
    at_roots = ((hulls.voxels[roots] >> 1) - low) @ strides + np.arange(len(hulls)) * boxes.shape[1]
    return Cells(
        codes,
        corners,
        corners + hulls.grid.spacing * _MIDDLE.take(codes, 0),
        _beside(dense, numbers, cells, _AROUND @ strides),
        numbers.take(at_roots),
        hulls.grid.spacing,
    )


def _corners(
    hulls: VisualHulls, low: Int[np.ndarray, "frames 3"], shape: list[int], cells: Int[np.ndarray, " cells"]
) -> Float[np.ndarray, "cells 3"]:
    """Where cells begin (m). What depends on x and y is made for each row along z: one division finds it."""
    edge = 2 * hulls.grid.spacing
    columns = np.indices((shape[0], shape[1], 1)).reshape(3, -1).T
    rows = (np.asarray(hulls.grid.origin) + edge * (low[:, None] + columns)).reshape(-1, 3)
    row = cells // shape[2]
    corners = rows.take(row, 0)
    corners[:, 2] += edge * (cells - row * shape[2])
    return corners


def _beside(
    dense: UInt8[np.ndarray, " places"],
    numbers: Int[np.ndarray, " places"],
    cells: Int[np.ndarray, " cells"],
    steps: Int[np.ndarray, " ways"],
) -> Int[np.ndarray, "cells ways"]:
    """The connected cells around each one, from the bytes and the numbers of all places, of which 0 is empty."""
    found = np.empty((len(cells), WAYS), np.int32)
    for start in range(0, len(cells), _AT_ONCE):
        some = cells[start : start + _AT_ONCE]
        around = some[:, None] + steps
        here = dense.take(some)[:, None] & _HERE
        there = dense.take(around, mode="clip") & _THERE
        mine = found[start : start + _AT_ONCE]
        numbers.take(around, out=mine, mode="clip")
        mine *= np.logical_and(here, there)
    return found
