"""Connected bodies from vertical runs equal those that SciPy labels voxel by voxel, for all frames at once."""

import numpy as np
import pytest
from scipy import ndimage

from jaxskel.hull import VisualHulls, VoxelGrid, bodies_among, hulls_from_dense
from jaxskel.hull._connected_bodies import find_bodies


def hulls(occupancy: np.ndarray) -> VisualHulls:
    return hulls_from_dense(occupancy, VoxelGrid(np.zeros(3), 0.02, occupancy.shape[1:]))


@pytest.mark.parametrize("share", [0.03, 0.1, 0.3, 0.7])
@pytest.mark.parametrize("shape", [(7, 6, 9), (3, 1, 20), (12, 12, 1)])
def test_bodies_are_those_of_single_voxels(share, shape):
    made = hulls(np.random.default_rng(int(100 * share)).random((5, *shape)) < share)
    bodies = find_bodies(made)
    assert bodies.sizes.sum() == made.inside.sum()
    for frame in range(5):
        voxels = made.voxels[made.inside[frame]]
        labels = np.asarray(ndimage.label(made.dense(frame), np.ones((3, 3, 3)))[0])[tuple(voxels.T)]
        sizes = np.bincount(labels)[1:]
        np.testing.assert_array_equal(bodies_among(voxels, made.grid).voxels_of(0), labels - 1)
        own = np.flatnonzero(bodies.frame_of_body == frame)
        np.testing.assert_array_equal(bodies.sizes[own], sizes)
        np.testing.assert_array_equal(bodies.voxels_of(frame), own[labels - 1])


def test_bodies_that_touch_at_a_corner_are_one_and_frames_do_not_mix():
    occupancy = np.zeros((3, 4, 4, 4), bool)
    occupancy[0, 0, 0, 0] = occupancy[0, 1, 1, 1] = True  # over a corner
    occupancy[1, 0, 0, :2] = occupancy[1, 0, 0, 3] = True  # one column, two runs
    occupancy[1, 3, 3, 3] = occupancy[1, 2, 2, 0] = True  # neighbours in the flattened grid only
    bodies = find_bodies(hulls(occupancy))
    assert bodies.frame_of_body.tolist() == [0, 1, 1, 1, 1]
    assert bodies.sizes.tolist() == [2, 2, 1, 1, 1]


def test_kept_are_the_voxels_of_the_chosen_bodies():
    occupancy = np.zeros((2, 3, 3, 8), bool)
    occupancy[0, 1, 1, [0, 1, 4]] = occupancy[1, 1, 1, [1, 2, 6]] = True
    made = hulls(occupancy)
    bodies = find_bodies(made)
    kept = made.only((bodies.sizes > 1)[bodies.body])
    assert [made.voxels[row, 2].tolist() for row in kept.inside] == [[0, 1], [1, 2]]
    assert [kept.voxels[kept.occupied(f), 2].tolist() for f in (0, 1)] == [[0, 1], [1, 2]]


def test_where_nothing_is_there_are_no_bodies():
    bodies = find_bodies(hulls(np.zeros((2, 3, 3, 3), bool)))
    assert len(bodies.sizes) == len(bodies.runs.frame) == 0


@pytest.mark.parametrize(
    "frames", [slice(1, 4), np.array([3, 0, 3]), np.array([True, False, True, True, False]), np.arange(0)]
)
def test_some_frames_keep_their_runs(frames):
    made = hulls(np.random.default_rng(3).random((5, 6, 5, 9)) < 0.4)
    anew = made[frames]
    runs = made.runs
    some = made.only(np.arange(len(runs.frame)) % 3 != 0)
    for known, same in ((made[frames], anew), (some[frames], VisualHulls(some.voxels, some.inside[frames], some.grid))):
        np.testing.assert_array_equal(known.inside, same.inside)
        for own, expected in zip(known.runs, same.runs, strict=True):
            np.testing.assert_array_equal(own, expected)
        for f in range(len(known)):
            np.testing.assert_array_equal(known.occupied(f), np.flatnonzero(known.inside[f]))
    assert some.inside.sum() < made.inside.sum()
