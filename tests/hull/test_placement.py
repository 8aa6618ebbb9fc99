import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.phantoms import chain, film, ring

from jaxskel import unpack_silhouettes
from jaxskel.hull import body_middles, carve, make_grid, place_grid, projection_table
from jaxskel.hull._connected_bodies import find_bodies
from jaxskel.recording import find_empty_views, silhouette_areas, silhouette_centroids

# Six cameras far enough away to see a walk through the room; a pixel is about 35 mm wide in the middle.
CAMERAS = ring(6, size=(240, 160), focal=170.0, radius=6.0)
SPACING = 0.03


def person(x=0.0, y=0.0, arm=None) -> np.ndarray:
    """Balls of a person 1.7 m tall who stands at (x, y), with one arm stretched to a direction, one hanging."""
    at = np.array([x, y, 0.0])
    arm = np.array([0.0, 0.0, -0.6]) if arm is None else np.asarray(arm)
    shoulder = np.array([0.0, 0.2, 1.35])
    return np.vstack(
        [
            chain(at + [0, 0, 0.8], at + [0, 0, 1.35], 0.16),
            chain(at + [0, 0, 1.55], at + [0, 0, 1.6], 0.1, 2),
            chain(at + [0, 0.1, 0.06], at + [0, 0.1, 0.8], 0.07),
            chain(at + [0, -0.1, 0.06], at + [0, -0.1, 0.8], 0.07),
            chain(at + shoulder, at + shoulder + arm, 0.06),
            chain(at + shoulder * [1, -1, 1], at + shoulder * [1, -1, 1] - [0, 0, 0.6], 0.06),
        ]
    )


def placed(silhouettes, cameras=CAMERAS, spacing=SPACING):
    empty_views = find_empty_views(silhouette_areas(silhouettes), cameras)
    return place_grid(cameras, silhouettes, empty_views, spacing, 3)


def contains(grid, balls) -> bool:
    lower, upper = (balls[:, :3] - balls[:, 3:]).min(0), (balls[:, :3] + balls[:, 3:]).max(0)
    return bool((np.asarray(grid.origin) <= lower).all() and (grid.upper >= upper).all())


@pytest.mark.parametrize(
    "body",
    [
        person(),
        person(0.9, -0.6),
        person(-1.1, 0.7),
        person(arm=(0.0, 1.0, 0.0)),
        person(0.4, 0.3, arm=(1.0, 0.0, 0.0)),
        person(arm=(0.0, 0.3, 0.95)),
        chain((-0.8, 0.0, 0.1), (0.8, 0.1, 0.1), 0.1),
    ],
    ids=["middle", "right", "left", "arm sideways", "arm to the front", "arm up", "lying"],
)
def test_grid_contains_the_body(body):
    grid = placed(film(CAMERAS, [body]))
    assert grid is not None
    assert contains(grid, body)
    # It is laid around the body, not around the room.
    span = (body[:, :3] + body[:, 3:]).max(0) - (body[:, :3] - body[:, 3:]).min(0)
    assert (grid.upper - np.asarray(grid.origin) < span + 0.7).all()


@pytest.mark.slow
@pytest.mark.parametrize("height", [36, 80])
@pytest.mark.parametrize(
    "body", [person(), person(0.3, -0.2), person(arm=(0.0, 1.0, 0.0)), person(arm=(0.0, 0.3, 0.95))]
)
def test_in_images_of_any_size_the_grid_contains_the_body_and_the_hull_of_it(height, body):
    cameras = ring(8, size=(height * 4 // 3, height), focal=1.1 * height)
    silhouettes = film(cameras, [body])
    inside = unpack_silhouettes(silhouettes[0], 8 * silhouettes.shape[3])
    assert not inside[:, [0, 1, height - 2, height - 1]].any(), "the person is whole in every view"
    grid = placed(silhouettes, cameras)
    assert grid is not None
    assert contains(grid, body)
    # The hull carved in a box that is large enough for anybody does not reach the edge of the grid either.
    room = make_grid(np.array([-1.0, -1.6, -0.6]), np.array([1.0, 1.6, 2.6]), SPACING)
    hulls = carve(silhouettes, projection_table(cameras, room, *inside.shape[1:], 3))
    bodies = find_bodies(hulls)
    largest = bodies.voxels_of(0) == np.argmax(bodies.sizes)
    voxels = hulls.voxels[hulls.inside[0]][largest]
    assert (np.asarray(room.origin) + SPACING * voxels.min(0) > np.asarray(grid.origin) + 1e-6).all()
    assert (np.asarray(room.origin) + SPACING * (voxels.max(0) + 1) < grid.upper - 1e-6).all()


@pytest.mark.parametrize("height", [240, 480])
@pytest.mark.parametrize("seed", range(3))
def test_a_limb_thinner_than_a_coarse_voxel_is_in_the_grid(height, seed):
    # One frame only: nothing else keeps the grid open where the arm is.
    cameras = ring(8, size=(height * 4 // 3, height), focal=1.1 * height)
    way = np.random.default_rng(seed).normal(size=3) * [1.0, 1.0, 0.3]
    body = person(*np.random.default_rng(seed).uniform(-0.1, 0.1, 2))
    shoulder = body[0, :3] * [1, 1, 0] + [0.0, 0.2, 1.35]
    thin = chain(shoulder, shoulder + 0.7 * way / np.linalg.norm(way), 0.012, 60)
    grid = placed(film(cameras, [np.vstack([body, thin])]), cameras, 0.015)
    assert grid is not None
    assert contains(grid, thin)


def test_grid_contains_a_walk_through_the_room():
    walk = [person(x, 0.3 * x, arm=(0.3, 0.4, 0.0)) for x in np.linspace(-1.5, 1.5, 7)]
    grid = placed(film(CAMERAS, walk))
    assert grid is not None
    assert all(contains(grid, body) for body in walk)


@pytest.mark.slow
def test_grid_contains_a_long_walk_of_which_it_sees_a_part():
    walk = [person(x) for x in np.linspace(-1.0, 1.0, 120)]  # more than the 96 frames that are sampled
    walk[61] = person(walk[61][0, 0], arm=(0.0, 0.75, 0.0))  # for one frame, with the steps around it
    cameras = ring(6, size=(120, 80), focal=85.0, radius=6.0)
    grid = placed(film(cameras, walk), cameras)
    assert grid is not None
    assert all(contains(grid, body) for body in walk[:61] + walk[62:])


def test_a_blob_of_noise_in_one_view_does_not_blow_the_grid_up():
    body = person(0.3, 0.2)
    silhouettes = film(CAMERAS, [body])
    clean = placed(silhouettes)
    noisy = silhouettes.copy()
    noisy[0, 3, 5:35, 1:5] = 255  # 30 x 32 pixels: as large as the person
    grid = placed(noisy)
    assert clean is not None
    assert grid is not None
    assert contains(grid, body)
    np.testing.assert_allclose(np.asarray(grid.origin), np.asarray(clean.origin), atol=0.2)
    np.testing.assert_allclose(grid.upper, clean.upper, atol=0.2)


def test_nobody_there_means_no_grid():
    silhouettes = film(CAMERAS, [person()])
    assert placed(np.zeros_like(silhouettes)) is None
    specks = np.zeros_like(silhouettes)
    specks[:, :, 80, 15] = 255
    assert placed(specks) is None
    two_views = np.zeros_like(silhouettes)
    two_views[:, :2] = silhouettes[:, :2]
    assert placed(two_views) is None
    contradicting = silhouettes.copy()
    contradicting[:, ::2] = np.roll(silhouettes[:, ::2], 10, axis=3)  # every other view is 80 pixels off
    assert placed(contradicting) is None


def test_body_middles_are_where_the_rays_meet():
    balls = [np.array([[0.4, -0.3, 1.1, 0.3]]), np.array([[-1.2, 0.5, 0.4, 0.25]])]
    silhouettes = film(CAMERAS, balls)
    empty_views = np.zeros((2, 6), bool)
    # To a pixel, and the centroid of a ball's outline is not quite its centre.
    np.testing.assert_allclose(body_middles(CAMERAS, silhouettes, empty_views), [b[0, :3] for b in balls], atol=0.02)
    empty_views[:, 2] = True
    silhouettes[:, 2] = 0
    np.testing.assert_allclose(body_middles(CAMERAS, silhouettes, empty_views), [b[0, :3] for b in balls], atol=0.02)


def test_body_middles_forgive_a_blob_of_noise():
    silhouettes = film(CAMERAS, [person()])
    empty_views = np.zeros((1, 6), bool)
    clean = body_middles(CAMERAS, silhouettes, empty_views)
    silhouettes[0, 3, 5:35, 1:5] = 255
    np.testing.assert_allclose(body_middles(CAMERAS, silhouettes, empty_views), clean, atol=0.1)


def test_areas_and_centroids_by_hand():
    masks = np.zeros((1, 2, 6, 16), bool)
    masks[0, 0, 1:5, 8:16] = True  # rows 1..4, a whole byte of columns 8..15
    silhouettes = np.packbits(masks, -1)
    np.testing.assert_array_equal(silhouette_areas(silhouettes), [[32, 0]])
    np.testing.assert_allclose(silhouette_centroids(silhouettes), [[[11.5, 2.5], [np.nan, np.nan]]])


@pytest.mark.parametrize(
    ("areas", "empty_views"),
    [
        ([900, 0, 1000, 900, 850, 800], [1]),
        ([900, 5, 1000, 900, 850, 800], [1]),
        ([900, 100, 1000, 900, 850, 800], []),  # half hidden, but there
        ([900, 40, 1000, 900, 20, 800], [1, 4]),  # less than a twentieth of the others
        ([0] * 6, range(6)),
        ([5] * 6, range(6)),  # specks in every view
        ([0, 0, 0, 0, 900, 900], range(4)),
        ([30] * 6, []),  # far away, but there: the least is 0.05 % of 240 x 160, 19 pixels
    ],
)
def test_lost_views(areas, empty_views):
    expected = np.isin(np.arange(6), list(empty_views))
    np.testing.assert_array_equal(find_empty_views(np.array([areas, [900] * 6]), CAMERAS), [expected, [False] * 6])


def test_a_view_is_lost_if_it_shows_much_less_than_the_median_of_those_that_show_somebody():
    rng = np.random.default_rng(7)
    areas = np.where(rng.random((200, 6)) < 0.3, 0, rng.integers(20, 9000, (200, 6)))
    shown = np.where(areas >= 5e-4 * 240 * 160, areas.astype(float), np.nan)
    somebody = ~np.isnan(shown).all(1)
    least = np.full(200, np.inf)
    least[somebody] = 0.05 * np.nanmedian(shown[somebody], axis=1)
    np.testing.assert_array_equal(find_empty_views(areas, CAMERAS), ~(shown >= least[:, None]))


coordinate = st.floats(-20, 20)
edge = st.floats(1e-3, 2.0)


@settings(deadline=None)
@given(st.tuples(coordinate, coordinate, coordinate), st.tuples(edge, edge, edge), st.floats(0.01, 0.5))
def test_make_grid_covers_the_box_and_no_more(lower, edges, spacing):
    lower, tolerance = np.array(lower), 1e-6 * spacing
    upper = lower + np.array(edges)
    grid = make_grid(lower, upper, spacing)
    origin = np.asarray(grid.origin)
    assert (origin <= lower + tolerance).all()
    assert (grid.upper >= upper - tolerance).all()
    # Its origin is at even multiples of the spacing. With two layers less at that end, or one less at the other end, it
    # would not cover the box.
    assert (origin + 2 * spacing > lower - tolerance).all()
    assert (grid.upper - spacing < upper + tolerance).all()
    np.testing.assert_allclose(origin / spacing, 2 * np.round(origin / (2 * spacing)), atol=1e-6)
    assert grid.size == np.prod(grid.shape)


def test_voxel_centres_by_hand():
    grid = make_grid(np.array([1.0, 0.0, -0.5]), np.array([2.0, 0.5, 0.0]), 0.5)
    assert grid.shape == (2, 1, 2)
    # A layer of voxels lies below the box.
    expected = [[1.25, 0.25, -0.75], [1.25, 0.25, -0.25], [1.75, 0.25, -0.75], [1.75, 0.25, -0.25]]
    np.testing.assert_allclose(grid.centres(), expected)


@pytest.mark.parametrize(
    ("lower", "upper", "spacing", "complaint"),
    [
        ([0, 0, 0], [1, 1, 1], 15.0, "0.015 is the usual"),
        ([0, 0, 0], [1, 1, 1], 0.0, "0.015 is the usual"),
        ([0, 0, 0], [1, 1, 1], np.nan, "0.015 is the usual"),
        ([0, 0, 0], [1, -1, 1], 0.1, "empty or not finite"),
        ([0, 0, 0], [1, 0, 1], 0.1, "empty or not finite"),
        ([0, np.nan, 0], [1, 1, 1], 0.1, "empty or not finite"),
        ([0, 0, 0], [np.inf, 1, 1], 0.1, "empty or not finite"),
        ([0, 0, 0], [1000, 1000, 1000], 0.015, "coarser spacing"),
    ],
)
def test_make_grid_refuses(lower, upper, spacing, complaint):
    with pytest.raises(ValueError, match=complaint):
        make_grid(np.array(lower), np.array(upper), spacing)
