"""Blocks of voxels: a block is seen where its voxels are seen, and voxels are recovered from blocks."""

import numpy as np
import pytest

from jaxskel.hull._blocks import (
    EDGE,
    INNER,
    SomeBlocks,
    blocks_of,
    count_blocks,
    find_footprints,
    grid_of_blocks,
    in_grid_order,
    nowhere,
    pooled,
    voxels_of,
)
from jaxskel.hull._frame_bits import CELL

HEIGHT, WIDTH = 104, 136
NOWHERE = np.zeros((1, 2), np.int32), np.zeros(1, np.uint32)
NOWHERE_TWICE = np.zeros((2, 2), np.int32), np.zeros(2, np.uint32)


def cells_of(images: np.ndarray) -> np.ndarray:
    """The words of cells of `CELL` by `CELL` pixels."""
    views, height, width = images.shape
    return np.bitwise_or.reduce(images.reshape(views, height // CELL, CELL, width // CELL, CELL), (2, 4))


@pytest.mark.parametrize("shape", [(8, 4, 12), (5, 6, 9), (1, 2, 3)])
def test_every_voxel_is_in_one_block(shape):
    blocks = np.arange(int(np.prod(grid_of_blocks(shape))))
    voxels = voxels_of(blocks, shape)
    np.testing.assert_array_equal(np.sort(voxels[voxels >= 0]), np.arange(np.prod(shape)))
    for block, own in enumerate(voxels):
        x, y, z = np.unravel_index(own[own >= 0], shape)
        place = np.stack([x, y, z]) // EDGE
        assert (np.ravel_multi_index(tuple(place), grid_of_blocks(shape)) == block).all()
        found, places = blocks_of(np.stack([x, y, z], 1), shape)
        np.testing.assert_array_equal(found, block)
        np.testing.assert_array_equal(voxels[found, places], own[own >= 0])


@pytest.mark.parametrize("shape", [(8, 4, 12), (5, 6, 9), (1, 2, 3)])
@pytest.mark.parametrize("counts", [(), (0,), (1,), (2, 0, 5)])
def test_voxels_of_blocks_in_the_order_of_the_grid(shape, counts):
    rng = np.random.default_rng(0)
    given, dense = [], np.zeros((len(counts), int(np.prod(shape))), np.uint32)
    for own, count in zip(dense, counts, strict=True):
        some = rng.permutation(count_blocks(shape))[:count]
        voxels = voxels_of(some, shape)
        found = np.where(voxels >= 0, rng.integers(0, 3, (len(some), INNER)), 0).astype(np.uint32)
        own[voxels[voxels >= 0]] = found[voxels >= 0]
        given.append(SomeBlocks(some, found))
    voxels, found = in_grid_order(given, shape)
    occupied = np.flatnonzero(dense.any(0))
    np.testing.assert_array_equal(voxels, np.stack(np.unravel_index(occupied, shape), 1))
    np.testing.assert_array_equal(found, dense[:, occupied])


@pytest.mark.parametrize("spread", [2, 8, 30, 200])
@pytest.mark.parametrize("seed", range(3))
def test_what_a_voxel_sees_its_block_sees(seed, spread):
    # Voxels fall on pixels at random around a middle for each block: from within one cell to all over the image.
    rng, shape = np.random.default_rng(seed), (9, 8, 6)
    blocks = grid_of_blocks(shape)
    middle = rng.integers(0, (HEIGHT, WIDTH), (*blocks, 2)).repeat(EDGE, 0).repeat(EDGE, 1).repeat(EDGE, 2)[:9, :8, :6]
    at = np.clip(middle + rng.integers(-spread, spread + 1, middle.shape), 0, (HEIGHT - 1, WIDTH - 1))
    pixels = (at[..., 0] * WIDTH + at[..., 1]).reshape(-1).astype(np.int32)
    pixels[rng.random(len(pixels)) < 0.003] = HEIGHT * WIDTH  # not seen
    voxels = voxels_of(np.arange(int(np.prod(blocks))), shape)
    own = pixels[np.where(voxels < 0, voxels[:, :1], voxels)]
    image = np.where(rng.random((HEIGHT, WIDTH)) < 0.01, rng.integers(1, 2**32, (HEIGHT, WIDTH)), 0).astype(np.uint32)
    cells = pooled(cells_of(image[None]), *NOWHERE, HEIGHT, WIDTH)[0]
    assert len(cells) == nowhere(HEIGHT, WIDTH) + 1
    assert cells[-1] == 0xFFFFFFFF
    seen = np.append(image, np.uint32(0xFFFFFFFF))[own]
    footprints = find_footprints(own, HEIGHT, WIDTH)
    assert not (np.bitwise_or.reduce(seen, 1) & ~cells[footprints]).any()
    assert (cells[footprints] != 0xFFFFFFFF).any() or spread > 8  # small footprints do occur


def test_windows_are_pooled_where_they_are():
    rng = np.random.default_rng(0)
    words = rng.integers(0, 2**32, (2, 24, 32)).astype(np.uint32)
    corner, blank = np.array([[8, 3], [72, 0]], np.int32), np.array([0, 5], np.uint32)
    images = np.tile(blank[:, None, None], (1, HEIGHT, WIDTH))
    for image, own, (row, byte) in zip(images, words, corner, strict=True):
        image[row : row + 24, 8 * byte : 8 * byte + 32] = own
    expected = pooled(cells_of(images), *NOWHERE_TWICE, HEIGHT, WIDTH)
    found = pooled(cells_of(words), corner, blank, HEIGHT, WIDTH)
    np.testing.assert_array_equal(found, expected)
