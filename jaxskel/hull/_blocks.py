"""Carving from coarse to fine: blocks of 4 x 4 x 4 voxels that no frame can occupy are left out beforehand.

A block is carved like a voxel, by all that its voxels can see: it is missed by a camera where nothing of the person
falls on any of the cells of the image around its voxels' pixels. So no voxel of a block that is left out is occupied.
"""

import math
from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, UInt32

from .._runtime.compile_cache import cached_jit
from ._frame_bits import ALL_FRAMES, CELL, in_place

EDGE = 4
"""Voxels along the edge of a block."""
INNER = EDGE**3
"""Voxels of a block. What is known of each voxel is kept block by block: that is how it is looked up."""
# Edges of cells (px), fine to coarse. A footprint is looked up in two by two of them.
_CELLS = tuple(CELL * times for times in (1, 2, 4, 8))


class SomeBlocks(NamedTuple):
    """Some blocks, and for each of their voxels the word of 32 frames."""

    blocks: Int[np.ndarray, " some"]
    words: UInt32[np.ndarray, "some inner"]


def grid_of_blocks(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Number of blocks along each axis."""
    return tuple(-(-n // EDGE) for n in shape)


def count_blocks(shape: tuple[int, ...]) -> int:
    """Number of blocks."""
    return math.prod(grid_of_blocks(shape))


def voxels_of(blocks: Int[np.ndarray, " some"], shape: tuple[int, ...]) -> Int[np.ndarray, "some inner"]:
    """The voxels of some blocks, as indices into the grid; -1 where a block juts out of it."""
    corner = EDGE * np.stack(np.unravel_index(blocks, grid_of_blocks(shape))).astype(np.int32)
    inner = np.stack(np.unravel_index(np.arange(INNER), (EDGE,) * 3)).astype(np.int32)
    strides = np.array([shape[1] * shape[2], shape[2], 1], np.int32)
    flat = (strides @ corner)[:, None] + strides @ inner
    outside = np.zeros(flat.shape, bool)
    for first, within, count in zip(corner, inner, shape, strict=True):
        last = np.flatnonzero(first + EDGE > count)
        outside[last] |= first[last, None] + within >= count
    flat[outside] = -1
    return flat


def blocks_of(
    voxels: Int[np.ndarray, "n 3"], shape: tuple[int, ...]
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """The block that each voxel, given by x, y and z, is in, and its place among the voxels of it."""
    x, y, z = (voxels[:, axis] for axis in range(3))
    _, columns, layers = grid_of_blocks(shape)
    block = (x // EDGE * columns + y // EDGE) * layers + z // EDGE
    return block, (x % EDGE * EDGE + y % EDGE) * EDGE + z % EDGE


def in_grid_order(
    found: Sequence[SomeBlocks], shape: tuple[int, ...]
) -> tuple[Int[np.ndarray, "voxels 3"], UInt32[np.ndarray, "words voxels"]]:
    """The voxels that are occupied in some frame of some word, in the grid's order, and all their words.

    Args:
        found: What each word leaves.
        shape: Of the grid.
    """
    grid = grid_of_blocks(shape)
    corners = [np.stack(np.unravel_index(each.blocks, grid)) for each in found]
    every = np.concatenate([np.zeros((3, 0), int), *corners], 1)
    first = every.min(1, initial=max(grid))
    extent = np.maximum(every.max(1, initial=-1) + 1 - first, 0)
    # Only as much of the grid as the blocks take up. A row of a block's voxels, 16 bytes, is moved as one number.
    rows = np.zeros((len(found), math.prod(extent), EDGE, EDGE), np.complex128)
    for own, at, each in zip(rows, corners, found, strict=True):
        places = np.ravel_multi_index(tuple(at - first[:, None]), extent)
        own[places] = each.words.view(rows.dtype).reshape(-1, EDGE, EDGE)
    ordered = rows.reshape(len(found), *extent, EDGE, EDGE).transpose(0, 1, 4, 2, 5, 3)
    dense = ordered.reshape(len(found), math.prod(extent) * EDGE**2).view(np.uint32)
    # NumPy finds what is true far sooner than what is not zero.
    occupied = np.flatnonzero(reduce(np.bitwise_or, dense, np.zeros(dense.shape[1], np.uint32)) != 0)
    voxels = np.empty((len(occupied), 3), np.int32)
    rest = occupied.astype(np.int32)
    for axis in (2, 1, 0):
        length = np.int32(EDGE * extent[axis])
        row = rest // length
        voxels[:, axis] = rest - row * length + np.int32(EDGE * first[axis])
        rest = row
    return voxels, dense.take(occupied, axis=1)


def nowhere(height: int, width: int) -> int:
    """The footprint of a block of which a camera does not see all, or which is larger in its image than any other."""
    return sum(rows * columns for rows, columns in _levels(height, width))


def find_footprints(pixels: Int[np.ndarray, "blocks inner"], height: int, width: int) -> Int[np.ndarray, " blocks"]:
    """Where one camera sees each block, from the pixels of its voxels (`height` times `width` where it sees none)."""
    v = pixels // np.int32(width)
    u = pixels - v * np.int32(width)
    top, bottom, left, right = v.min(1), v.max(1), u.min(1), u.max(1)
    seen = pixels.max(1) < height * width
    total = nowhere(height, width)
    found = np.full(len(top), total, np.int32)
    start = 0
    for cell, (rows, columns) in zip(_CELLS, _levels(height, width), strict=True):
        small = (bottom // cell - top // cell <= 1) & (right // cell - left // cell <= 1)
        here = small & (found == total) & seen
        found[here] = start + (top[here] // cell) * columns + left[here] // cell
        start += rows * columns
    return found


@cached_jit
def pooled(
    words: UInt32[Array, "cams rows columns"],
    corner: Int[Array | np.ndarray, "cams 2"],
    blank: UInt32[Array | np.ndarray, " cams"],
    height: int,
    width: int,
) -> UInt32[Array, "cams cells"]:
    """Of two by two cells each, from their upper left one on, which frames have the person on any pixel; by size.

    After the last of them comes what is not seen.

    Args:
        words: Of the windows, see `cut_windows`.
        corner: Row and byte of each window.
        blank: The word of all other pixels.
        height: Of the whole images (px).
        width: Likewise.
    """
    levels = []
    edge = CELL
    cells = _any_of(_any_of(words, 1, edge), 2, edge)
    row_and_column = jnp.asarray(corner) // jnp.array([[CELL, 1]])
    cells = in_place(cells, row_and_column, blank, *_levels(height, width)[0])
    for cell in _CELLS:
        cells, edge = _any_of(_any_of(cells, 1, cell // edge), 2, cell // edge), cell
        two = cells | jnp.pad(cells[:, 1:], ((0, 0), (0, 1), (0, 0)))
        two |= jnp.pad(two[:, :, 1:], ((0, 0), (0, 0), (0, 1)))
        levels.append(two.reshape(len(words), -1))
    return jnp.concatenate([*levels, jnp.full((len(words), 1), ALL_FRAMES)], 1)


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
