"""Signed distances to silhouettes, on masks that are drawn by hand."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.phantoms import film, ring

from jaxskel import Cameras, make_cameras, pack_silhouettes
from jaxskel.outlines import SilhouetteDistances, silhouette_distances

FOCAL = 100.0
# OpenCV's 3 x 3 distance transform gives a step along a row this length; errors are at most 5 %.
STEP = 0.955


def standing(*sizes: tuple[int, int]) -> Cameras:
    """Cameras at the origin that look along z, with images of some sizes (width, height)."""
    K = [[[FOCAL, 0.0, (width - 1) / 2], [0.0, FOCAL, (height - 1) / 2], [0.0, 0.0, 1.0]] for width, height in sizes]
    count = len(sizes)
    return make_cameras(K, np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)), np.array(sizes))


def measured(
    masks: Sequence[np.ndarray], cameras: Cameras, empty_views: Sequence[bool] | None = None
) -> SilhouetteDistances:
    """Distances of one frame, in a batch of two frames whose other one is black."""
    height, width = (max(mask.shape[axis] for mask in masks) for axis in (0, 1))
    whole = np.zeros((2, len(masks), height, width), bool)
    for view, mask in enumerate(masks):
        whole[1, view, : mask.shape[0], : mask.shape[1]] = mask
    gone = np.zeros((2, len(masks)), bool)
    gone[1] = gone[1] if empty_views is None else empty_views
    found = silhouette_distances(pack_silhouettes(whole), cameras, gone, misses=1)
    assert found.misses.tolist() == [1, 1]
    return jax.tree.map(lambda a: jnp.asarray(a)[1], found)


def images(found: SilhouetteDistances, cameras: int = 1) -> np.ndarray:
    """The values that mean something."""
    return np.asarray(found.values)[:cameras, : np.prod(found.shape)]


def in_metres(found: SilhouetteDistances, points: np.ndarray) -> np.ndarray:
    return np.asarray(_at(found, jnp.asarray(points, jnp.float32)))


@eqx.filter_jit
def _at(found: SilhouetteDistances, points: jax.Array) -> jax.Array:
    return found.at(points)


def at_pixels(found: SilhouetteDistances, view: int, pixels: Sequence, depth: float = 2.0) -> np.ndarray:
    """Distances (px) in a view at points that it sees at some pixels (u, v)."""
    pixels = np.atleast_2d(np.asarray(pixels, float))
    K = np.asarray(found.cameras.K[view])
    points = np.column_stack([depth * (pixels - K[:2, 2]) / FOCAL, np.full(len(pixels), depth)])
    return in_metres(found, points)[view] * FOCAL / depth


def disc(width: int, height: int, centre: tuple[float, float], radius: float) -> np.ndarray:
    v, u = np.mgrid[:height, :width]
    return np.hypot(u - centre[0], v - centre[1]) < radius


def left_of(edge: int, width: int, height: int) -> np.ndarray:
    """The person fills all columns up to an edge and is cut off by the image on three sides."""
    mask = np.zeros((height, width), bool)
    mask[:, :edge] = True
    return mask


def test_outline_of_a_disc_is_half_way_between_pixels():
    # On the row through the middle, pixels 18..42 are filled; so are rows 12..36 of the middle column.
    found = measured([disc(64, 48, (30, 24), 12.3)], standing((64, 48)))
    np.testing.assert_allclose(at_pixels(found, 0, [(42.5, 24), (17.5, 24), (30, 36.5), (30, 11.5)]), 0.0, atol=1e-4)
    np.testing.assert_allclose(at_pixels(found, 0, [(42, 24), (43, 24)]), [0.5 - STEP, STEP - 0.5], atol=1e-4)


def test_distance_from_a_disc_grows_evenly_in_all_directions():
    found = measured([disc(64, 48, (30, 24), 12.3)], standing((64, 48)))
    angle = np.linspace(0, 2 * np.pi, 40)
    for radius in (3.0, 7.0, 11.0, 12.5, 14.0, 18.0, 22.0):
        around = np.column_stack([30 + radius * np.cos(angle), 24 + radius * np.sin(angle)])
        np.testing.assert_allclose(at_pixels(found, 0, around), radius - 12.5, atol=0.6 + 0.05 * abs(radius - 12.5))


@pytest.mark.parametrize("depth", [0.5, 2.0, 7.0])
def test_metres_are_pixels_at_the_depth_of_the_point(depth):
    found = measured([left_of(20, 64, 48)], standing((64, 48)))
    x = np.array([-4.0, 0.0, 3.0])  # px from the outline at 19.5
    points = np.column_stack([(19.5 + x - 31.5) * depth / FOCAL, np.zeros(3), np.full(3, depth)])
    expected = np.sign(x) * (STEP * (np.abs(x) + 0.5) - 0.5)  # the first half pixel counts whole
    expected[1] = 0.0
    np.testing.assert_allclose(in_metres(found, points)[0], expected * depth / FOCAL, atol=0.05 * depth / FOCAL)


def test_what_a_view_does_not_see_it_calls_inside():
    found = measured([left_of(20, 64, 48)], standing((64, 48)))
    outside = [(-0.6, 24), (63.6, 24), (30, -0.6), (30, 47.6), (500, 24)]
    points = [[2 * (u - 31.5) / FOCAL, 2 * (v - 23.5) / FOCAL, 2.0] for u, v in outside]
    behind = [[0.0, 0.0, -2.0], [0.0, 0.0, 0.0]]
    np.testing.assert_array_equal(in_metres(found, np.array(points + behind))[0], -1.0)
    # Half a pixel from the middle of the first and last pixels still belongs to the image.
    within = at_pixels(found, 0, [(-0.4, 24), (63.4, 24), (30, -0.4), (30, 47.4)])
    assert within[0] < -15
    assert (within[1:] > 9).all()


def test_lost_views_call_everything_far_inside_and_black_ones_far_outside():
    cameras = standing((64, 48), (64, 48), (64, 48))
    masks = [left_of(20, 64, 48), left_of(20, 64, 48), np.zeros((48, 64), bool)]
    found = measured(masks, cameras, empty_views=[False, True, False])
    places = [(5, 5), (19.5, 24), (60, 40)]
    assert (at_pixels(found, 1, places) * 2 / FOCAL < -1).all()
    np.testing.assert_allclose(at_pixels(found, 2, places), 40.0, rtol=1e-5)
    assert np.abs(at_pixels(found, 0, places)[1]) < 1e-3


@pytest.mark.parametrize(("width", "height"), [(64, 48), (640, 480), (641, 478), (1600, 1203)])
def test_a_person_cut_off_goes_on_beyond_the_edge(width, height):
    # Also where the last cell of several pixels is not whole.
    rows = [0, height / 2, height - 1]
    from_left = measured([left_of(20, width, height)], standing((width, height)))
    from_right = measured([~left_of(width - 20, width, height)], standing((width, height)))
    at_edge = STEP * 20 - 0.5
    step = float(from_left.step)
    left = at_pixels(from_left, 0, [(0, row) for row in rows])
    right = at_pixels(from_right, 0, [(width - 1, row) for row in rows])
    np.testing.assert_allclose(left, -at_edge, atol=0.1 + step / 2)
    np.testing.assert_allclose(right, -at_edge, atol=0.1 + step / 2)


@pytest.mark.parametrize(("width", "height", "step"), [(320, 48, 1), (321, 48, 2), (640, 480, 2), (1600, 1200, 5)])
@pytest.mark.parametrize("edge", [100, 101, 103])
def test_large_images_are_measured_in_cells_of_several_pixels(width, height, step, edge):
    found = measured([left_of(edge, width, height)], standing((width, height)))
    assert float(found.step) == step
    # The array's rows are of whole bytes.
    assert np.asarray(found.shape).tolist() == [-(-height // step), -(-8 * -(-width // 8) // step)]
    # Images that need larger cells are made smaller first, to two pixels a cell: half such a pixel is a quarter.
    exact = (0.1 if step <= 2 else 0.25) * step
    # Within the cell that the outline goes through, and beyond it in steps of a whole cell.
    np.testing.assert_allclose(at_pixels(found, 0, [(edge - 0.5, 20)]), 0.0, atol=exact)
    far = step * np.array([-5.0, -2.0, 2.0, 5.0])
    got = at_pixels(found, 0, [(edge - 0.5 + x, 20) for x in far])
    np.testing.assert_allclose(got, far, atol=exact + 0.05 * np.abs(far).max())


def test_images_of_different_sizes_share_a_rig():
    # The smaller image's person touches its right and lower edges: what lies beyond is no background.
    sizes = (40, 30), (64, 48)
    small = np.zeros((30, 40), bool)
    small[20:, 30:] = True
    large = disc(64, 48, (30, 24), 12.3)
    found = measured([small, large], standing(*sizes))
    alone = [measured([mask], standing(size)) for mask, size in zip((small, large), sizes, strict=True)]
    for view, (width, height) in enumerate(sizes):
        places = [(u, v) for u in np.linspace(0, width - 1, 9) for v in np.linspace(0, height - 1, 7)]
        np.testing.assert_allclose(at_pixels(found, view, places), at_pixels(alone[view], 0, places), atol=0.02)
    assert at_pixels(found, 0, [(39, 29)])[0] < -8
    # Pixels that only the larger image has give no information.
    assert (at_pixels(found, 0, [(45, 10), (10, 40), (60, 45)]) * 2 / FOCAL < -1).all()


def test_rigs_of_similar_size_and_images_of_any_shape_share_compiled_code():
    few = measured([disc(64, 48, (30, 24), 12.3)] * 5, standing(*[(64, 48)] * 5))
    cameras = standing(*[(300, 400)] * 8)
    named = make_cameras(cameras.K, cameras.R, cameras.t, cameras.size, names=list("abcdefgh"))
    many = measured([disc(300, 400, (30, 24), 12.3)] * 8, named)
    assert jax.tree.structure(few) == jax.tree.structure(many)
    assert [(a.shape, a.dtype) for a in jax.tree.leaves(few)] == [(a.shape, a.dtype) for a in jax.tree.leaves(many)]


@pytest.mark.slow
@pytest.mark.parametrize("count", [3, 5, 9])
def test_blind_cameras_fill_up_the_rig_and_tell_nothing(count):
    sizes = [(40 + 8 * view, 30) for view in range(count)]
    found = measured([disc(*size, (20, 15), 6.3) for size in sizes], standing(*sizes))
    assert len(found.cameras) == {3: 4, 5: 8, 9: 12}[count]
    places = np.column_stack([np.random.default_rng(0).uniform(-0.1, 0.1, (50, 2)), np.full(50, 2.0)])
    places = jnp.asarray(places, jnp.float32)
    seen, distances = found.seen_at(places)
    assert np.asarray(seen).any(1)[:count].all()
    assert not np.asarray(seen)[count:].any()
    np.testing.assert_array_equal(distances[count:], -1.0)
    np.testing.assert_array_equal(found.empty_views, np.arange(len(found.cameras)) >= count)
    for axis in jax.tree.leaves(found.with_gradient(places)[1]):
        assert np.isfinite(axis).all()
        np.testing.assert_array_equal(axis[count:], 0.0)


def test_far_away_distances_stay_at_forty_pixels():
    found = measured([disc(300, 200, (30, 24), 12.3)], standing((300, 200)))
    assert images(found).max() == 40.0
    np.testing.assert_allclose(at_pixels(found, 0, [(250, 150), (110, 24)]), 40.0, rtol=1e-5)


def test_an_image_full_of_person_has_no_outline():
    found = measured([np.ones((48, 64), bool)], standing((64, 48)))
    assert np.isfinite(images(found)).all()
    assert images(found).max() < -64


# Other ways to look them up


def ring_of_lenses() -> Cameras:
    """Four views of the origin from 3 m, two of them through bad lenses."""
    cameras = ring(4)
    dist = np.zeros((4, 8))
    dist[1, :5], dist[3] = [-0.25, 0.08, 0.002, -0.003, 0.01], [0.3, 0.1, -0.001, 0.002, 0.02, 0.55, 0.2, 0.04]
    return make_cameras(cameras.K, cameras.R, cameras.t, cameras.size, dist)


def seen_by_lenses() -> SilhouetteDistances:
    cameras = ring_of_lenses()
    found = silhouette_distances(film(cameras, [np.array([[0.0, 0.0, 0.9, 0.25]])]), cameras, np.zeros((1, 4), bool))
    return jax.tree.map(lambda a: jnp.asarray(a)[0], found)


@pytest.mark.slow
def test_the_gradient_is_that_of_the_interpolated_distance():
    found = seen_by_lenses()
    points = jnp.asarray(np.random.default_rng(0).normal([0, 0, 0.9], 0.4, (60, 3)), jnp.float32)
    # One is behind some of the cameras and outside of the images of others.
    points = points.at[0].set(jnp.array([0.0, 0.0, 40.0]))
    value, gradient = eqx.filter_jit(SilhouetteDistances.with_gradient)(found, points)
    expected, change = jax.linearize(found.at, points)
    np.testing.assert_allclose(value, expected, atol=1e-6)
    assert np.abs(gradient[0]).max() > 0.5
    for axis, ours in enumerate(gradient):
        theirs = change(jnp.zeros_like(points).at[:, axis].set(1.0))
        np.testing.assert_allclose(ours, theirs, atol=2e-4)


def test_the_nearest_cell_is_right_to_half_a_cell():
    found = seen_by_lenses()
    points = jnp.asarray(np.random.default_rng(2).normal([0, 0, 0.9], 0.3, (200, 3)), jnp.float32)
    exact, near = (
        np.asarray(eqx.filter_jit(way)(found, points)) for way in (SilhouetteDistances.at, SilhouetteDistances.near)
    )
    np.testing.assert_array_equal(exact == -1.0, near == -1.0)
    cell = float(found.step) * 4.0 / float(found.cameras.K[0, 0, 0])  # m, at a depth of 4 m
    assert np.abs(exact - near).max() < cell
    assert np.abs(exact - near).max() > 0.1 * cell
