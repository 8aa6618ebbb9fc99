"""Cells preserve the positions and the connectivity of their voxels."""

import numpy as np
import pytest
from scipy import ndimage
from support.partitions import same_partition

from jaxskel.graph._cells import Cells, cells_of
from jaxskel.graph._wavefront import Wave
from jaxskel.hull import VoxelGrid, hulls_from_dense

SPACING, ORIGIN = 0.5, np.array([1.0, -2.0, 0.25])
ROOT = 5, 6, 7


def crumbs(seed: int, density: float) -> np.ndarray:
    """Two frames of random voxels, the second one elsewhere on the grid."""
    dense = np.random.default_rng(seed).random((2, 11, 9, 12)) < density
    dense[0, 7:], dense[1, :3], dense[1, :, :4] = False, False, False
    dense[(slice(None), *ROOT)] = True
    return dense


def cells_and_voxels(dense: np.ndarray) -> tuple[Cells, np.ndarray, list[tuple[int, np.ndarray]]]:
    """The cells, the roots' cells, and by hand the frame and voxels of each non-empty cell, in grid order."""
    hulls = hulls_from_dense(dense, VoxelGrid(ORIGIN, SPACING, dense.shape[1:]))
    root = int(np.flatnonzero((hulls.voxels == ROOT).all(1))[0])
    held = []
    for f, frame in enumerate(dense):
        places = np.argwhere(frame)
        _, which = np.unique(places // 2, axis=0, return_inverse=True)
        held += [(f, places[which == cell]) for cell in range(which.max() + 1)]
    return *cells_of(hulls, np.full(2, root)), held


@pytest.mark.parametrize("density", [0.0, 0.05, 0.3, 0.9])
def test_cells_are_where_their_voxels_are(density):
    cells, roots, held = cells_and_voxels(crumbs(3, density))
    some = np.flatnonzero(cells.codes)
    assert len(some) == len(held)
    middles = cells.middles(some)
    bounds = cells.bounds(some, middles)
    low, high = -bounds[:, :3], bounds[:, 3:]
    np.testing.assert_array_equal(cells.counts(some), [len(places) for _, places in held])
    np.testing.assert_allclose(low, [ORIGIN + SPACING * places.min(0) for _, places in held], atol=1e-12)
    np.testing.assert_allclose(high, [ORIGIN + SPACING * (places.max(0) + 1) for _, places in held], atol=1e-12)
    expected = [ORIGIN + SPACING * (places.mean(0) + 0.5) for _, places in held]
    np.testing.assert_allclose(middles, expected, atol=1e-12)
    for f, root in enumerate(roots):
        frame, places = held[int(np.flatnonzero(some == root)[0])]
        assert frame == f
        assert (places == ROOT).all(1).any()


@pytest.mark.parametrize("density", [0.05, 0.15, 0.4])
def test_a_wave_goes_on_to_cells_with_voxels_beside_those_of_its_own(density):
    cells, _, held = cells_and_voxels(crumbs(4, density))
    some = np.flatnonzero(cells.codes)
    wave = Wave(cells)
    for i, (f, own) in enumerate(held):
        beside = [
            j
            for j, (g, others) in enumerate(held)
            if i != j and f == g and (np.abs(own[:, None] - others).max(-1) <= 1).any()
        ]
        seen, owners = wave.seen(some[[i]], np.array([7]))
        np.testing.assert_array_equal(np.sort(seen), some[beside])
        np.testing.assert_array_equal(owners, 7)
    wave.mark_visited(some[::2])
    every, _ = wave.seen(some, np.arange(len(some)))
    assert np.isin(every, some[1::2]).all()
    assert len(np.unique(every)) == len(every)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("density", [0.05, 0.15, 0.4])
def test_components_are_those_of_the_voxels_of_each_owner(seed, density):
    dense = crumbs(seed, density)
    cells, _, held = cells_and_voxels(dense)
    rng = np.random.default_rng(seed)
    chosen = rng.permutation(len(held))[: len(held) // 2]
    owners = rng.integers(0, 2, len(chosen)) + 2 * np.array([held[i][0] for i in chosen])  # frames share none
    owned = np.full(dense.shape, -1)
    for i, owner in zip(chosen, owners, strict=True):
        f, places = held[i]
        owned[f][tuple(places.T)] = owner
    expected = np.zeros(dense.shape, int)
    for f in range(2):
        for owner in range(4):
            labels, _ = ndimage.label(owned[f] == owner, np.ones((3, 3, 3)))
            expected[f][labels > 0] = labels[labels > 0] + 1000 * owner
    of_cells = np.array([expected[f][tuple(places[0])] for f, places in (held[i] for i in chosen)])
    wave, some = Wave(cells), np.flatnonzero(cells.codes)
    for _ in range(2):  # earlier calls leave no trace
        assert same_partition(wave.components(some[chosen], owners), of_cells)
