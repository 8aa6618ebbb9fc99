"""What cells say of voxels: where they are, and what is connected."""

import numpy as np
import pytest
from partitions import same_partition
from scipy import ndimage

from jaxskel._cells import WAYS, Cells, cells_of
from jaxskel._grid import VoxelGrid
from jaxskel._hull import hulls_from_dense
from jaxskel._wave import Wave

SPACING, ORIGIN = 0.5, np.array([1.0, -2.0, 0.25])


def crumbs(seed: int, density: float) -> np.ndarray:
    """Two frames of crumbs, the second one elsewhere on the grid."""
    dense = np.random.default_rng(seed).random((2, 11, 9, 12)) < density
    dense[0, 7:], dense[1, :3], dense[1, :, :4] = False, False, False
    dense[:, 5, 6, 7] = True
    return dense


def cells_and_voxels(dense: np.ndarray) -> tuple[Cells, list[list[np.ndarray]]]:
    """The cells, and by hand the voxels of each cell of each frame, in the grid's order."""
    hulls = hulls_from_dense(dense, VoxelGrid(ORIGIN, SPACING, dense.shape[1:]))
    root = int(np.flatnonzero((hulls.voxels == (5, 6, 7)).all(1))[0])
    voxels = []
    for frame in dense:
        places = np.argwhere(frame)
        _, which = np.unique(places // 2, axis=0, return_inverse=True)
        voxels.append([places[which == cell] for cell in range(which.max() + 1)])
    return cells_of(hulls, np.full(2, root)), voxels


@pytest.mark.parametrize("density", [0.0, 0.05, 0.3, 0.9])
def test_cells_are_where_their_voxels_are(density):
    cells, voxels = cells_and_voxels(crumbs(3, density))
    flat = [places for frame in voxels for places in frame]
    assert len(cells.codes) == 1 + len(flat)
    assert cells.codes[0] == 0
    some = np.arange(1, len(cells.codes))
    np.testing.assert_array_equal(cells.counts(some), [len(places) for places in flat])
    middles = [ORIGIN + SPACING * (places.mean(0) + 0.5) for places in flat]
    np.testing.assert_allclose(cells.middles[some], middles, atol=1e-12)
    low, high = cells.extents(some)
    np.testing.assert_allclose(low, [ORIGIN + SPACING * places.min(0) for places in flat], atol=1e-12)
    np.testing.assert_allclose(high, [ORIGIN + SPACING * (places.max(0) + 1) for places in flat], atol=1e-12)
    for cell, inside in zip(cells.of_roots - 1, ((5, 6, 7), (5, 6, 7)), strict=True):
        assert (flat[cell] == inside).all(1).any()
    assert cells.of_roots[0] <= len(voxels[0]) < cells.of_roots[1]


@pytest.mark.parametrize("density", [0.05, 0.15, 0.4])
def test_cells_beside_each_other_have_voxels_beside_each_other(density):
    cells, voxels = cells_and_voxels(crumbs(4, density))
    flat = [(f, places) for f, frame in enumerate(voxels) for places in frame]
    expected = {
        (i, j)
        for i, (f, some) in enumerate(flat, 1)
        for j, (g, others) in enumerate(flat, 1)
        if i != j and f == g and (np.abs(some[:, None] - others).max(-1) <= 1).any()
    }
    found, ways = np.nonzero(cells.beside)
    assert set(zip(found.tolist(), cells.beside[found, ways].tolist(), strict=True)) == expected
    # The other way round it is the opposite way.
    np.testing.assert_array_equal(cells.beside[cells.beside[found, ways], WAYS - 1 - ways], found)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("density", [0.05, 0.15, 0.4])
def test_components_are_those_of_the_voxels_of_each_owner(seed, density):
    dense = crumbs(seed, density)
    cells, voxels = cells_and_voxels(dense)
    rng = np.random.default_rng(seed)
    owners = rng.integers(0, 2, len(cells.codes)) + 2 * (np.arange(len(cells.codes)) > len(voxels[0]))
    chosen = rng.permutation(np.arange(1, len(cells.codes)))[: len(cells.codes) // 2]
    owned = np.full(dense.shape, -1)
    flat = [(f, places) for f, frame in enumerate(voxels) for places in frame]
    for cell in chosen:
        f, places = flat[cell - 1]
        owned[f][tuple(places.T)] = owners[cell]
    expected = np.zeros(dense.shape, int)
    for f in range(2):
        for owner in range(4):
            labels, _ = ndimage.label(owned[f] == owner, np.ones((3, 3, 3)))
            expected[f][labels > 0] = labels[labels > 0] + 1000 * owner
    of_cells = np.array([expected[f][tuple(places[0])] for f, places in (flat[cell - 1] for cell in chosen)])
    wave = Wave(cells)
    for _ in range(2):  # and what went before leaves no trace
        assert same_partition(wave.components(chosen, owners[chosen]), of_cells)
