"""Blocks of voxels: each is seen where its voxels are, and they are found again."""

import numpy as np
import pytest

from jaxskel._blocks import EDGE, find_footprints, grid_of_blocks, pooled, voxels_of

HEIGHT, WIDTH = 100, 136


@pytest.mark.parametrize("shape", [(8, 4, 12), (5, 6, 9), (1, 2, 3)])
def test_every_voxel_is_in_one_block(shape):
    blocks = np.arange(int(np.prod(grid_of_blocks(shape))))
    np.testing.assert_array_equal(np.sort(voxels_of(blocks, shape)), np.arange(np.prod(shape)))
    for block in blocks:
        x, y, z = np.unravel_index(voxels_of(np.array([block]), shape), shape)
        place = np.stack([x, y, z]) // EDGE
        assert (np.ravel_multi_index(tuple(place), grid_of_blocks(shape)) == block).all()


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
    words = np.where(rng.random(HEIGHT * WIDTH) < 0.01, rng.integers(1, 2**32, HEIGHT * WIDTH), 0).astype(np.uint32)
    cells = np.append(np.asarray(pooled(words[None], HEIGHT, WIDTH))[0], np.uint32(0xFFFFFFFF))
    footprints = find_footprints(pixels, shape, HEIGHT, WIDTH)
    seen = np.append(words, np.uint32(0xFFFFFFFF))[pixels]
    told = 0
    for block, footprint in enumerate(footprints):
        own = voxels_of(np.array([block]), shape)
        assert np.bitwise_or.reduce(seen[own]) & ~cells[footprint] == 0
        told += cells[footprint] != 0xFFFFFFFF
    assert told or spread > 8  # and small footprints tell something
