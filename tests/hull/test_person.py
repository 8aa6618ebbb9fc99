"""Whether views show the whole person."""

import numpy as np
import pytest
from support.phantoms import ring

from jaxskel.cameras import project
from jaxskel.hull import VoxelGrid, hulls_from_dense, projection_table
from jaxskel.hull._people import seen_whole, shares_outside


@pytest.mark.parametrize("focal", [40.0, 300.0, 900.0])
def test_shares_outside_are_those_of_the_voxels_centres(focal):
    # A wide lens shows all of the grid, a long one cuts it: in part, or so that no block is seen whole.
    cameras, grid = ring(5, focal=focal), VoxelGrid(np.array([-0.5, -0.4, 0.0]), 0.1, (10, 9, 21))
    hulls = hulls_from_dense(np.random.default_rng(0).random((3, *grid.shape)) < 0.2, grid)
    shares = shares_outside(hulls, projection_table(cameras, grid, 120, 160, 0))
    u, v, _ = map(np.asarray, project(cameras, hulls.centres))
    out = ~((u > -0.5) & (u < 159.5) & (v > -0.5) & (v < 119.5))
    expected = np.stack([out[:, inside].mean(1) for inside in hulls.inside])
    np.testing.assert_allclose(shares, expected, atol=1e-12)
    assert (shares.max() > 0.1) == (focal > 40)


def test_too_few_whole_views_are_told():
    # Long lenses cut the body in every view, a wide one shows all of it.
    grid = VoxelGrid(np.array([-0.5, -0.4, 0.0]), 0.1, (10, 9, 21))
    hulls = hulls_from_dense(np.ones((2, *grid.shape), bool), grid)
    for focal, whole in ((90.0, True), (500.0, False)):
        table = projection_table(ring(5, focal=focal), grid, 120, 160)
        np.testing.assert_array_equal(seen_whole(hulls, table, np.zeros((2, 5), bool)), whole)
