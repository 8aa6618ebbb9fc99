"""How many cameras may err: none for consistent masks, some for masks with holes."""

import equinox as eqx
import numpy as np
import pytest
from support.phantoms import chain, film, ring
from support.recordings import with_masks

from jaxskel import pack_silhouettes, unpack_silhouettes
from jaxskel.hull import (
    VisualHulls,
    VoxelGrid,
    carve,
    find_people,
    judge_misses,
    make_grid,
    most_misses,
    observed_edge,
    projection_table,
)
from jaxskel.hull._max_misses import filled_shares
from jaxskel.recording import find_empty_views, silhouette_areas
from jaxskel.synthetic import make_scene

SPACING = 0.02
MIN_VIEWS = 2


@pytest.fixture(scope="module")
def scene():
    return make_scene(8)


def lost_in(recording):
    return find_empty_views(silhouette_areas(recording.silhouettes), recording.cameras)


def judged(recording, box=None):
    return judge_misses(recording.cameras, recording.silhouettes, lost_in(recording), MIN_VIEWS, box)


def seen_by(recording, chosen):
    """The recording of some of the cameras."""
    parts = recording.cameras[list(chosen)], recording.silhouettes[:, list(chosen)]
    return eqx.tree_at(lambda r: (r.cameras, r.silhouettes), recording, parts)


def masks_of(recording):
    return np.array(unpack_silhouettes(recording.silhouettes, 8 * recording.silhouettes.shape[3]))


def with_holes(recording, share=0.12, seed=0):
    """Cut discs out around random points of the person, as wide as a share of the person's height in the image."""
    rng = np.random.default_rng(seed)
    masks = masks_of(recording)
    rows, columns = np.ogrid[: masks.shape[2], : masks.shape[3]]
    for frame in masks:
        for view in frame:
            person = np.argwhere(view)
            if not len(person):
                continue
            v, u = person[rng.integers(len(person))]
            radius = share / 2 * np.ptp(person[:, 0])
            view[(rows - v) ** 2 + (columns - u) ** 2 <= radius**2] = False
    return with_masks(recording, pack_silhouettes(masks))


def person_in(recording, misses):
    """Share of the true joints inside the person that is found in each hull, and the person's median volume (m^3)."""
    cameras, silhouettes, empty_views = recording.cameras, recording.silhouettes, lost_in(recording)
    joints = recording.truth.joints
    grid = make_grid(joints.min((0, 1)) - 0.3, joints.max((0, 1)) + 0.3, SPACING)
    table = projection_table(cameras, grid, silhouettes.shape[2], 8 * silhouettes.shape[3], MIN_VIEWS + misses)
    edge = observed_edge(np.asarray(table.observed).reshape(grid.shape))
    people = find_people(carve(silhouettes, table, empty_views, misses), edge).hulls
    where = np.floor((joints - np.asarray(grid.origin)) / grid.spacing).astype(int)
    inside = [people.dense(f)[tuple(where[f].T)].mean() for f in range(len(people))]
    return np.mean(inside), np.median(people.volumes)


@pytest.mark.parametrize(
    ("views", "most"), [(0, 0), (2, 0), (3, 0), (4, 1), (5, 1), (6, 2), (7, 2), (8, 2), (9, 3), (10, 3), (30, 10)]
)
def test_most_misses_by_hand(views, most):
    assert most_misses(views) == most


@pytest.mark.parametrize("chosen", [range(8), [0, 1, 3, 4, 6, 7], [0, 2, 4, 6], [0, 3, 6]], ids=len)
def test_consistent_masks_need_no_misses(scene, chosen):
    assert judged(seen_by(scene, chosen)) == 0


@pytest.mark.slow
@pytest.mark.parametrize("chosen", [range(8), [0, 1, 3, 4, 6, 7], [0, 2, 4, 6]], ids=len)
def test_holes_in_all_views_are_voted_away(scene, chosen):
    clean = seen_by(scene, chosen)
    holed = with_holes(clean)
    misses = judged(holed)
    assert 1 <= misses <= most_misses(len(chosen))
    torn, _ = person_in(holed, 0)
    inside, volume = person_in(holed, misses)
    assert torn < 0.8
    assert inside > 0.85
    # Allowed misses enlarge the hull, but it is still that of a person.
    assert volume < 2 * person_in(clean, 0)[1]


def test_one_bad_camera_is_outvoted_by_one_miss(scene):
    masks = masks_of(scene)
    rows = np.flatnonzero(masks[:, 2].any((0, 2)))
    masks[:, 2, rows[0] : rows[len(rows) // 2]] = False  # a beam hides the upper half of the person
    assert judged(with_masks(scene, pack_silhouettes(masks))) == 1


def test_what_no_hull_fills_is_no_reason_for_misses(scene):
    masks = masks_of(scene)
    masks[:, ::2, :60, :60] = True  # noise in a corner of every other view, larger than the person there
    noisy = with_masks(scene, pack_silhouettes(masks))
    assert (silhouette_areas(noisy.silhouettes)[:, ::2] > 1.2 * silhouette_areas(scene.silhouettes)[:, ::2]).all()
    assert judged(noisy) == 0


def test_three_views_have_no_vote_to_spare(scene):
    assert judged(with_holes(seen_by(scene, [0, 3, 6]))) == 0


def test_black_views_have_no_vote(scene):
    masks = masks_of(scene)
    for f, frame in enumerate(masks):
        frame[f % 8] = False
    assert judged(with_masks(scene, pack_silhouettes(masks))) == 0
    masks[:, 3:] = False
    assert judged(with_holes(with_masks(scene, pack_silhouettes(masks)))) == 0


def test_nobody_there_means_no_misses(scene):
    assert judged(with_masks(scene, np.zeros_like(scene.silhouettes))) == 0


def test_a_given_box_is_where_it_looks(scene):
    holed = with_holes(scene)
    room = np.array([[-1.5, -1.5, -0.1], [1.5, 1.5, 2.4]])
    assert judged(holed, room) == judged(holed) > 0
    assert judged(scene, room) == 0
    # Where nobody is, nothing can be filled, however many misses are forgiven.
    assert judged(holed, room + [0, 0, 4]) == 0


def test_min_views_count_the_cameras_that_see_a_voxel():
    cameras = ring(5)
    grid = VoxelGrid(np.array([-8.0, -8.0, -2.0]), 1.0, (16, 16, 8))
    table = projection_table(cameras, grid, 120, 160, 1)
    for min_views in (2, 4, 5):
        expected = projection_table(cameras, grid, 120, 160, min_views).observed
        assert 0 < np.asarray(expected).sum() < grid.size
        np.testing.assert_array_equal(table.with_min_views(min_views).observed, expected)


def test_filled_shares_of_a_person_with_one_arm():
    # Long upright capsules beside each other; the hull is carved from one of them, the silhouettes show some more.
    cameras = ring(6)
    left, right = (chain((0.0, y, 0.4), (0.0, y, 1.6), 0.15, 60) for y in (-0.6, 0.6))
    one, both = film(cameras, [left]), film(cameras, [np.vstack([left, right])])
    grid = VoxelGrid(np.array([-1.0, -1.0, 0.0]), 0.05, (40, 40, 40))
    table = projection_table(cameras, grid, 120, 160)
    empty_views = np.zeros((1, 6), bool)
    empty_views[0, 4] = True
    hulls = carve(one, table, empty_views)
    shares = filled_shares(hulls, one, empty_views, cameras, table)
    np.testing.assert_array_equal(np.isnan(shares), empty_views)
    assert np.nanmin(shares) > 0.95
    # Of both capsules the hull fills what the first one covers, give or take a cell at the edge.
    covered = silhouette_areas(one & both) / silhouette_areas(both)
    np.testing.assert_allclose(
        filled_shares(hulls, both, empty_views, cameras, table)[~empty_views], covered[~empty_views], atol=0.1
    )
    assert covered.min() < 0.7
    empty = VisualHulls(hulls.voxels, np.zeros_like(hulls.inside), grid)
    np.testing.assert_array_equal(filled_shares(empty, one, empty_views, cameras, table)[~empty_views], 0)
