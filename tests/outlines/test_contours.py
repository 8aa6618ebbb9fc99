"""The outlines of silhouettes as viewing rays, on masks that are drawn by hand."""

import numpy as np
import pytest
from support.phantoms import film, looking_at, ring

from jaxskel import make_cameras, pack_silhouettes, unpack_silhouettes
from jaxskel.cameras import project
from jaxskel.outlines import contours

# A wide lens, in OpenCV's order.
BARREL = [-0.28, 0.09, 0.002, -0.003, -0.01]


def one_camera(width: int = 16, height: int = 12, dist=None):
    """At the origin, looking along z, without rotation: the ray of (u, v) is (u - cx, v - cy, 10)."""
    K = np.array([[[10.0, 0.0, 8.0], [0.0, 10.0, 6.0], [0.0, 0.0, 1.0]]])
    return make_cameras(K, np.eye(3)[None], np.zeros((1, 3)), (width, height), dist)


def drawn(*pixels: tuple[slice, slice], width: int = 16, height: int = 12) -> np.ndarray:
    """A mask with some rectangles of rows and columns filled."""
    mask = np.zeros((height, width), bool)
    for rectangle in pixels:
        mask[rectangle] = True
    return mask


def seen(mask: np.ndarray, cameras=None, count: int = 400) -> set[tuple[float, float]]:
    """Outline points (px) that the rays of a single view go through."""
    cameras = one_camera() if cameras is None else cameras
    found = contours(pack_silhouettes(mask[None, None]), cameras, np.zeros((1, 1), bool), count)
    u, v, depth = project(cameras, np.asarray(found.centres[0] + found.directions[0], np.float64))
    assert (depth > 0).all()
    return {(float(x), float(y)) for x, y in zip(u[0].round(3), v[0].round(3), strict=True)}


# What is filled, and the outline.
MASKS = {
    "a pixel": ([(slice(4, 5), slice(7, 8))], {(6.5, 4), (7.5, 4), (7, 3.5), (7, 4.5)}),
    "two pixels in a row": (
        [(slice(4, 5), slice(7, 9))],
        {(6.5, 4), (8.5, 4), (7, 3.5), (8, 3.5), (7, 4.5), (8, 4.5)},
    ),
    "pixels that meet at a corner": (
        [(slice(4, 5), slice(7, 8)), (slice(5, 6), slice(8, 9))],
        {(6.5, 4), (7.5, 4), (7, 3.5), (7, 4.5), (7.5, 5), (8.5, 5), (8, 4.5), (8, 5.5)},
    ),
    # The person is cut off by the corner of the image, so there is no outline there.
    "a corner of the image": ([(slice(0, 1), slice(0, 1))], {(0.5, 0), (0, 0.5)}),
    "the last corner": ([(slice(11, 12), slice(15, 16))], {(14.5, 11), (15, 10.5)}),
    "a band across the image": ([(slice(5, 7), slice(0, 16))], {(u, v) for u in range(16) for v in (4.5, 6.5)}),
}


@pytest.mark.parametrize("name", MASKS)
def test_outlines_by_hand(name):
    filled, expected = MASKS[name]
    assert seen(drawn(*filled)) == expected


def test_holes_have_outlines_too():
    mask = drawn((slice(0, 12), slice(0, 16)))
    mask[4, 7] = False
    assert seen(mask) == {(6.5, 4), (7.5, 4), (7, 3.5), (7, 4.5)}


def test_columns_beyond_the_image_are_only_filling():
    # 13 pixels take two bytes: the last three bits are padding, not background.
    mask = drawn((slice(2, 4), slice(11, 13)), width=13)
    assert seen(mask, one_camera(13)) == {(10.5, 2), (10.5, 3), (11, 1.5), (12, 1.5), (11, 3.5), (12, 3.5)}


def test_of_smaller_images_the_rest_of_the_array_is_only_filling():
    # Two cameras of different sizes share an array; the smaller one's person is cut off by its right and lower edge.
    small, large = one_camera(10, 8), one_camera(16, 12)
    K, R, t, size = (np.concatenate([getattr(c, name) for c in (small, large)]) for name in ("K", "R", "t", "size"))
    both = make_cameras(K, R, t, size)
    masks = np.stack([drawn((slice(6, 8), slice(7, 10))), drawn()])
    found = contours(pack_silhouettes(masks[None]), both, np.zeros((1, 2), bool), 200)
    directions = np.asarray(found.directions[0], np.float64)
    u, v = (10 * directions[:, axis] / directions[:, 2] + (8, 6)[axis] for axis in (0, 1))
    outline = {(float(x), float(y)) for x, y in zip(u.round(3), v.round(3), strict=True)}
    assert outline == {(6.5, 6), (6.5, 7), (7, 5.5), (8, 5.5), (9, 5.5)}


@pytest.fixture(scope="module")
def filmed():
    """Two frames of two balls in five views."""
    cameras = ring(5)
    bodies = [np.array([[0.0, 0.1, 1.2, 0.3], [0.2, 0.0, 0.7, 0.2]]), np.array([[0.3, 0.0, 0.9, 0.25]])]
    return cameras, film(cameras, bodies)


def cameras_of(found, frame: int, cameras) -> np.ndarray:
    """Number of the camera that each ray comes from."""
    apart = np.linalg.norm(found.centres[frame][:, None] - cameras.centres[None], axis=-1)
    assert apart.min(1).max() < 1e-5
    return apart.argmin(1)


def test_views_have_equal_shares(filmed):
    cameras, silhouettes = filmed
    found = contours(silhouettes, cameras, np.zeros((2, 5), bool), 203)
    assert found.centres.shape == found.directions.shape == (2, 203, 3)
    np.testing.assert_allclose(np.linalg.norm(found.directions, axis=-1), 1.0, atol=1e-6)
    for frame in range(2):
        counts = np.bincount(cameras_of(found, frame, cameras), minlength=5)
        assert counts.sum() == 203
        assert set(counts) <= {40, 41}


def test_lost_and_empty_views_are_left_out(filmed):
    cameras, silhouettes = filmed
    empty_views = np.zeros((2, 5), bool)
    empty_views[0, [1, 3]] = True
    silhouettes = silhouettes.copy()
    silhouettes[1, 0] = 0
    found = contours(silhouettes, cameras, empty_views, 120)
    for frame, counts in enumerate(([40, 0, 40, 0, 40], [0, 30, 30, 30, 30])):
        np.testing.assert_array_equal(np.bincount(cameras_of(found, frame, cameras), minlength=5), counts)


def test_frames_do_not_depend_on_each_other_nor_on_chance(filmed):
    cameras, silhouettes = filmed
    empty_views = np.array([[False] * 5, [True] + [False] * 4])
    both = contours(silhouettes, cameras, empty_views, 100)
    for frame in range(2):
        alone = contours(silhouettes[[frame]], cameras, empty_views[[frame]], 100)
        np.testing.assert_array_equal(alone.centres[0], both.centres[frame])
        np.testing.assert_array_equal(alone.directions[0], both.directions[frame])


def test_points_are_drawn_once_where_there_are_enough_and_all_of_them_where_not():
    # The square has 40 outline points.
    silhouettes, empty_views = pack_silhouettes(drawn((slice(1, 11), slice(3, 13)))[None, None]), np.zeros((1, 1), bool)
    for count, different, most in ((25, 25, 1), (40, 40, 1), (100, 40, 3)):
        directions = contours(silhouettes, one_camera(), empty_views, count).directions[0]
        rows, times = np.unique(directions.round(5), axis=0, return_counts=True)
        assert (len(rows), times.max()) == (different, most)
        assert times.min() >= most - 1


def test_without_any_outline_all_rays_are_nan():
    nobody, everywhere = drawn(), drawn((slice(0, 12), slice(0, 16)))
    square = drawn((slice(2, 5), slice(2, 5)))
    silhouettes = pack_silhouettes(np.stack([nobody, everywhere, square, square])[:, None])
    found = contours(silhouettes, one_camera(), np.array([[False], [False], [True], [False]]), 50)
    for rays in (found.centres, found.directions):
        assert np.isnan(rays[:3]).all()
        assert np.isfinite(rays[3]).all()


@pytest.mark.parametrize("dist", [None, [BARREL]])
def test_rays_project_onto_the_outline(dist):
    R, t = looking_at(np.array([2.0, 0.5, 2.0]), np.array([0.0, 0.0, 0.9]))
    K = np.array([[190.0, 4.0, 160.0], [0.0, 195.0, 120.0], [0.0, 0.0, 1.0]])
    cameras = make_cameras(K[None], R[None], t[None], (320, 240), dist)
    silhouettes = film(cameras, [np.array([[0.0, 0.1, 1.2, 0.4], [0.1, -0.2, 0.6, 0.3]])])
    mask = unpack_silhouettes(silhouettes, 320)[0, 0]
    found = contours(silhouettes, cameras, np.zeros((1, 1), bool), 300)
    # At different places on the ray: near the body and beyond it.
    for along in (0.5, 4.0):
        points = np.asarray(found.centres[0] + along * found.directions[0], np.float64)
        u, v, _ = (np.asarray(a)[0] for a in project(cameras, points))
        on_row = np.abs(v - v.round()) < 1e-3
        # One coordinate is whole, the other half-way between two pixels, of which one shows the person.
        whole, half = np.where(on_row, v, u), np.where(on_row, u, v)
        np.testing.assert_allclose(whole, whole.round(), atol=1e-3)
        np.testing.assert_allclose(half, np.floor(half) + 0.5, atol=1e-3)
        first = (
            np.where(on_row, np.floor(u), u.round()).astype(int),
            np.where(on_row, v.round(), np.floor(v)).astype(int),
        )
        second = first[0] + on_row, first[1] + ~on_row
        assert (mask[first[1], first[0]] != mask[second[1], second[0]]).all()
        assert 0 < on_row.sum() < 300


def test_rays_graze_a_ball():
    # Seen by a fine camera: the outline is half a pixel wide at most, 4 m / 90 px / 2 here.
    cameras, centre, radius = ring(4), np.array([0.1, -0.2, 1.1]), 0.4
    silhouettes = film(cameras, [np.array([[*centre, radius]])])
    found = contours(silhouettes, cameras, np.zeros((1, 4), bool), 200)
    away = centre - found.centres[0]
    apart = np.linalg.norm(away - (away * found.directions[0]).sum(1, keepdims=True) * found.directions[0], axis=1)
    assert np.abs(apart - radius).max() < 0.5 * 4.5 / 90
    assert abs(apart.mean() - radius) < 0.003
