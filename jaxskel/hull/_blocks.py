"""Coarse-to-fine carving: blocks of 4 x 4 x 4 voxels that are empty in every frame are skipped.

A block is carved like a voxel. A camera misses it if no person pixel lies in any of the image cells that cover the
projections of its voxels. The test is conservative: no voxel of a skipped block is occupied.
"""

import math
from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np
from jaxtyping import Int, UInt

from ._frame_bits import CELL, all_frames

EDGE = 4
"""Voxels along the edge of a block."""
INNER = EDGE**3
"""Voxels per block. Data of single voxels are stored block by block, because carving reads them that way."""
# Edge lengths of image cells (px), each twice the one before. The footprint of a block covers 2 x 2 cells of a size.
_CELLS = tuple(CELL * times for times in (1, 2, 4, 8))


class SomeBlocks(NamedTuple):
    """A selection of blocks and, for each of their voxels, the occupancy in 32 frames, or in one, as one word."""

    blocks: Int[np.ndarray, " some"]
    words: UInt[np.ndarray, "some inner"]


def grid_of_blocks(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Number of blocks along each axis."""
    return tuple(-(-n // EDGE) for n in shape)


def count_blocks(shape: tuple[int, ...]) -> int:
    """Number of blocks."""
    return math.prod(grid_of_blocks(shape))


def voxels_of(blocks: Int[np.ndarray, " some"], shape: tuple[int, ...]) -> Int[np.ndarray, "some inner"]:
    """Flat grid indices of the voxels of the given blocks; -1 where a block extends beyond the grid."""
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
    """Block of each voxel (given by its grid indices x, y, z), and the position of the voxel within that block."""
    x, y, z = (voxels[:, axis] for axis in range(3))
    _, columns, layers = grid_of_blocks(shape)
    block = (x // EDGE * columns + y // EDGE) * layers + z // EDGE
    return block, (x % EDGE * EDGE + y % EDGE) * EDGE + z % EDGE


def in_grid_order(
    found: Sequence[SomeBlocks], shape: tuple[int, ...]
) -> tuple[Int[np.ndarray, "voxels 3"], UInt[np.ndarray, "words voxels"]]:
    """Collect the voxels that are occupied in any frame, in grid order, and all their words.

    Args:
        found: For each word of frames, the blocks that are not empty.
        shape: Shape of the grid (voxels).
    """
    grid = grid_of_blocks(shape)
    corners = [np.stack(np.unravel_index(each.blocks, grid)) for each in found]
    every = np.concatenate([np.zeros((3, 0), int), *corners], 1)
    first = every.min(1, initial=max(grid))
    extent = np.maximum(every.max(1, initial=-1) + 1 - first, 0)
    # Allocate only the bounding box of the blocks. A row of four voxels, 16 bytes, moves as one complex number; that of
    # one frame as one integer.
    word = found[0].words.dtype if found else np.dtype(np.uint32)
    rows = np.zeros((len(found), math.prod(extent), EDGE, EDGE), np.complex128 if word.itemsize == 4 else np.uint32)
    for own, at, each in zip(rows, corners, found, strict=True):
        places = np.ravel_multi_index(tuple(at - first[:, None]), extent)
        own[places] = each.words.view(rows.dtype).reshape(-1, EDGE, EDGE)
    ordered = rows.reshape(len(found), *extent, EDGE, EDGE).transpose(0, 1, 4, 2, 5, 3)
    dense = ordered.reshape(len(found), math.prod(extent) * EDGE**2).view(word)
    # NumPy finds true booleans much faster than nonzero integers.
    occupied = np.flatnonzero(reduce(np.bitwise_or, dense, np.zeros(dense.shape[1], word)) != 0)
    voxels = np.empty((len(occupied), 3), np.int32)
    rest = occupied.astype(np.int32)
    for axis in (2, 1, 0):
        length = np.int32(EDGE * extent[axis])
        row = rest // length
        voxels[:, axis] = rest - row * length + np.int32(EDGE * first[axis])
        rest = row
    return voxels, dense.take(occupied, axis=1)


def nowhere(height: int, width: int) -> int:
    """Footprint of a block that a camera sees only in part, or that exceeds 2 x 2 of the largest image cells."""
    return sum(rows * columns for rows, columns in _levels(height, width))


def find_footprints(pixels: Int[np.ndarray, "blocks inner"], height: int, width: int) -> Int[np.ndarray, " blocks"]:
    """Footprint of each block in one camera, from the pixels of its voxels (``height * width`` if not seen)."""
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


def pooled(
    cells: UInt[np.ndarray, "cams rows columns"],
    corner: Int[np.ndarray, "cams 2"],
    blank: UInt[np.ndarray, " cams"],
    height: int,
    width: int,
) -> UInt[np.ndarray, "cams cells"]:
    """For each cell size and each 2 x 2 cells, named by the upper left one: the frames with any person pixel there.

    The last entry stands for places that are not seen; it has all frames.

    Args:
        cells: Words of the windows' smallest cells, see `cell_words`.
        corner: Row and byte of each window in its image.
        blank: Word of all other pixels.
        height: Height of the whole images (px).
        width: Width of the whole images (px).
    """
    whole = np.empty((len(cells), *_levels(height, width)[0]), cells.dtype)
    whole[:] = blank[:, None, None]
    for image, part, (row, column) in zip(whole, cells, corner // [CELL, 1], strict=True):
        image[row : row + part.shape[0], column : column + part.shape[1]] = part
    levels = []
    for _ in _CELLS:
        two = whole.copy()
        two[:, :-1] |= whole[:, 1:]
        two[:, :, :-1] |= two[:, :, 1:].copy()
        levels.append(two.reshape(len(two), -1))
        whole = _twice_as_large(whole)
    return np.concatenate([*levels, np.full((len(cells), 1), all_frames(cells))], 1)


def _levels(height: int, width: int) -> list[tuple[int, int]]:
    return [(-(-height // cell), -(-width // cell)) for cell in _CELLS]


def _twice_as_large(cells: UInt[np.ndarray, "cams rows columns"]) -> UInt[np.ndarray, "cams less fewer"]:
    """OR 2 x 2 neighbours; the last of a row or column may be alone."""
    cells = np.pad(cells, [(0, 0), *((0, length % 2) for length in cells.shape[1:])])
    cells = cells[:, ::2] | cells[:, 1::2]
    return cells[:, :, ::2] | cells[:, :, 1::2]
