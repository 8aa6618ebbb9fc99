"""Carving from coarse to fine: blocks of 4 x 4 x 4 voxels that no frame can occupy are left out beforehand.

A block is carved like a voxel, by all that its voxels can see: it is missed by a camera where nothing of the person
falls on any of the cells of the image around its voxels' pixels. So no voxel of a block that is left out is occupied.
"""

import math
from collections.abc import Callable
from functools import reduce
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, UInt32

from ._kept import kept

EDGE = 4
"""Voxels along the edge of a block."""
# Edges of cells (px), fine to coarse. A footprint is looked up in two by two of them.
_CELLS = (8, 16, 32, 64)


def grid_of_blocks(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Number of blocks along each axis."""
    return tuple(-(-n // EDGE) for n in shape)


def count_blocks(shape: tuple[int, ...]) -> int:
    """Number of blocks."""
    return math.prod(grid_of_blocks(shape))


def find_footprints(
    pixels: Int[np.ndarray, " voxels"], shape: tuple[int, ...], height: int, width: int
) -> Int[np.ndarray, " blocks"]:
    """Where one camera sees each block, from the pixels of the voxels (`height` times `width` where it is not seen)."""
    v, u = np.divmod(pixels.astype(np.int32), np.int32(width))
    unseen_in = _over_blocks(pixels == height * width, shape, False, np.maximum)
    top, bottom = _over_blocks(v, shape, height, np.minimum), _over_blocks(v, shape, -1, np.maximum)
    left, right = _over_blocks(u, shape, width, np.minimum), _over_blocks(u, shape, -1, np.maximum)
    total = sum(rows * columns for rows, columns in _levels(height, width))
    found = np.full(len(top), total, np.int32)
    start = 0
    for cell, (rows, columns) in zip(_CELLS, _levels(height, width), strict=True):
        small = (bottom // cell - top // cell <= 1) & (right // cell - left // cell <= 1)
        here = small & (found == total) & ~unseen_in
        found[here] = start + (top[here] // cell) * columns + left[here] // cell
        start += rows * columns
    return found


@kept
def pooled(words: UInt32[Array, "cams pixels"], height: int, width: int) -> UInt32[Array, "cams cells"]:
    """Of two by two cells each, from their upper left one on, which frames have the person on any pixel; by size."""
    levels = []
    cells = words.reshape(-1, height, width)
    edge = 1
    for cell in _CELLS:
        cells, edge = _any_of(_any_of(cells, 1, cell // edge), 2, cell // edge), cell
        two = cells | jnp.pad(cells[:, 1:], ((0, 0), (0, 1), (0, 0)))
        two |= jnp.pad(two[:, :, 1:], ((0, 0), (0, 0), (0, 1)))
        levels.append(two.reshape(len(words), -1))
    return jnp.concatenate(levels, 1)


def voxels_of(blocks: Int[np.ndarray, " some"], shape: tuple[int, ...]) -> Int[np.ndarray, " voxels"]:
    """The voxels of some blocks, as indices into the grid."""
    corner = EDGE * np.stack(np.unravel_index(blocks, grid_of_blocks(shape))).astype(np.int32)
    x, y, z = (axis[:, None] + np.arange(EDGE, dtype=np.int32) for axis in corner)
    row = x[:, :, None] * np.int32(shape[1]) + y[:, None]
    flat = row[..., None] * np.int32(shape[2]) + z[:, None, None]
    if not any(n % EDGE for n in shape):
        return flat.reshape(-1)
    there = [axis < n for axis, n in zip((x, y, z), shape, strict=True)]
    return flat[there[0][:, :, None, None] & there[1][:, None, :, None] & there[2][:, None, None]]


def _levels(height: int, width: int) -> list[tuple[int, int]]:
    return [(-(-height // cell), -(-width // cell)) for cell in _CELLS]


def _any_of(cells: UInt32[Array, "cams rows columns"], axis: int, count: int) -> UInt32[Array, "cams less fewer"]:
    """So many neighbours along an axis put together; the last one may have fewer."""
    length = cells.shape[axis]
    padding = [(0, 0)] * 3
    padding[axis] = (0, -length % count)
    cells = jnp.pad(cells, padding)
    found = jax.lax.slice_in_dim(cells, 0, None, count, axis)
    for first in range(1, count):
        found |= jax.lax.slice_in_dim(cells, first, None, count, axis)
    return found


def _over_blocks(
    values: np.ndarray, shape: tuple[int, ...], fill: int | bool, over: Callable[[Any, Any], np.ndarray]
) -> np.ndarray:
    """The least or largest of each block's voxels."""
    values = np.pad(values.reshape(shape), [(0, -n % EDGE) for n in shape], constant_values=fill)
    # Whole slices of numbers are compared, not the few of each block.
    for axis in (2, 1, 0):
        ahead = (slice(None),) * axis
        values = reduce(over, [values[*ahead, first::EDGE] for first in range(EDGE)])
    return values.reshape(-1)
