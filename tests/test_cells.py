"""Connectivity by cells is connectivity of voxels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from jaxskel._cells import Cells, connected

BOX = (8, 6, 10)


def same_partition(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two labellings put the same things together."""
    pairs = np.unique(np.stack([one, other]), axis=1)
    return len(np.unique(one)) == len(np.unique(other)) == pairs.shape[1]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("density", [0.05, 0.15, 0.4])
def test_components_are_those_of_the_voxels_of_each_owner_and_frame(seed, density):
    rng = np.random.default_rng(seed)
    owned = np.where(rng.random((2, *BOX)) < density, rng.integers(1, 4, (2, *BOX)), 0)
    owned[:, 0], owned[:, -1] = 0, 0  # a box has an empty margin
    owned[:, :, 0], owned[:, :, -1], owned[..., 0], owned[..., -1] = 0, 0, 0, 0
    frame, x, y, z = np.nonzero(owned)
    order = rng.permutation(len(frame))
    frame, x, y, z = (axis[order] for axis in (frame, x, y, z))
    owners = owned[frame, x, y, z] + 3 * frame  # frames share no owner
    cells = Cells(2, BOX)
    places = (((frame * BOX[0] + x) // 2 * BOX[1] + y) // 2 * BOX[2] + z) // 2
    corners = 4 * (x % 2) + 2 * (y % 2) + z % 2
    expected = np.zeros(owned.shape, int)
    for f in range(2):
        for owner in range(1, 4):
            labels, _ = ndimage.label(owned[f] == owner, np.ones((3, 3, 3)))
            expected[f][labels > 0] = labels[labels > 0] + 1000 * owner + 10_000 * f
    for _ in range(2):  # and what went before leaves no trace
        assert same_partition(cells.components(places, corners, owners), expected[frame, x, y, z])


@settings(deadline=None)
@given(st.integers(1, 12).flatmap(lambda n: st.lists(st.tuples(st.integers(0, n - 1), st.integers(0, n - 1)))))
def test_pairs_connect_as_scipy_says(pairs):
    count = 1 + max((max(pair) for pair in pairs), default=0)
    one, other = np.array(pairs, int).reshape(-1, 2).T
    matrix = csr_array((np.ones(len(one)), (one, other)), shape=(count, count))
    expected = connected_components(matrix, directed=False)[1]
    labels = connected(one, other, count)
    assert same_partition(labels, expected)
    assert labels.max() == expected.max()
