import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads
from support.phantoms import chain, film, ring

from jaxskel import make_cameras, pack_silhouettes, unpack_silhouettes
from jaxskel.cameras import project
from jaxskel.hull import carve, carve_soft, make_grid, projection_table
from jaxskel.outlines import SilhouetteDistances, silhouette_distances

# A simple person made of two bars, one of them from the trunk to the front.
BALLS = np.concatenate([chain((0.0, 0.0, 0.6), (0.1, 0.0, 1.4), 0.16), chain((0.05, 0.0, 1.2), (0.1, 0.5, 1.0), 0.08)])
GRID = make_grid(np.array([-0.6, -0.6, 0.2]), np.array([0.7, 0.9, 1.8]), 0.05)
soft = eqx.filter_jit(carve_soft)
T = np.float32(0.05)  # m, an array because a number would be static


def with_lenses(count: int):
    """A ring of cameras; the second and the fourth have bad lenses, the last one stands close and sees a part only."""
    rig = ring(count, size=(160, 120), focal=110.0)
    dist, K = np.zeros((count, 8)), np.array(rig.K)
    dist[1, :5], dist[3] = [-0.25, 0.08, 0.002, -0.003, 0.01], [0.3, 0.1, -0.001, 0.002, 0.02, 0.55, 0.2, 0.04]
    K[-1, [0, 1], [0, 1]] = 330.0
    return make_cameras(K, rig.R, rig.t, rig.size, dist)


CAMERAS = with_lenses(6)
PACKED = film(CAMERAS, [BALLS])


def seen(packed=PACKED, cameras=CAMERAS, empty_views=()) -> SilhouetteDistances:
    """Distances of one frame."""
    gone = np.zeros((1, len(cameras)), bool)
    gone[:, list(empty_views)] = True
    return jax.tree.map(lambda a: a[0], silhouette_distances(packed, cameras, gone))


def in_double(tree):
    return jax.tree.map(lambda a: jnp.asarray(a, float) if a.dtype.kind == "f" else a, tree)


def around(count: int, seed=0) -> np.ndarray:
    """Points near the body, inside and outside."""
    rng = np.random.default_rng(seed)
    return BALLS[rng.integers(len(BALLS), size=count), :3] + rng.normal(0, 0.15, (count, 3))


@pytest.mark.slow
@pytest.mark.parametrize(("max_misses", "min_views"), [(0, 2), (0, 6), (2, 4)])
def test_it_becomes_the_hard_hull_as_the_temperature_goes_to_zero(max_misses, min_views):
    empty_views = [2]
    height, width = PACKED.shape[2], 8 * PACKED.shape[3]
    gone = np.isin(np.arange(6), empty_views)[None]
    hull = carve(PACKED, projection_table(CAMERAS, GRID, height, width, min_views), gone, max_misses).dense(0).ravel()
    distances = seen(empty_views=empty_views)
    occupancy = np.asarray(soft(distances, GRID.centres(), np.float32(1e-4), max_misses, min_views))
    # A voxel that falls on the pixels next to an outline, or to the edge of an image, may be rounded another way.
    apart = np.abs(np.asarray(distances.at(jnp.asarray(GRID.centres(), jnp.float32)))).min(0)
    clear = (apart > 0.04) & ~at_an_edge()
    np.testing.assert_array_equal(occupancy[clear] > 0.5, hull[clear])
    # Enough voxels are compared, and their occupancy is no longer soft.
    assert hull[clear].sum() > 50
    assert (~hull[clear]).sum() > 2000
    assert (np.abs(occupancy - 0.5)[clear] > 0.499).all()


def at_an_edge() -> np.ndarray:
    """Voxels that a camera sees within a pixel of the edge of its image."""
    u, v, _ = (np.asarray(a) for a in project(CAMERAS, GRID.centres()))
    width, height = CAMERAS.size.T[..., None]
    near = [np.abs(a - edge) < 1 for a, edge in ((u, -0.5), (u, width - 0.5), (v, -0.5), (v, height - 0.5))]
    return np.any(near, (0, 1))


def read(distances, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance of each point from the outline of each view (px), and whether the view sees it."""
    at, seen_at = (eqx.filter_jit(each)(jnp.asarray(points, jnp.float32)) for each in (distances.at, distances.seen_at))
    return np.asarray(at, float), np.asarray(seen_at[0])


def test_occupancy_is_the_product_of_sigmoids_of_the_views_that_see():
    distances, points = seen(empty_views=[1]), around(300)
    points[0] = [3.8, 0.3, 1.2]  # behind the first camera or beside the view of others
    each, known = read(distances, points)
    known = known & (np.arange(8) != 1)[:, None]
    assert 0 < known[[0, 2, 3, 4, 5]].mean() < 1
    factors = np.where(known, 1 / (1 + np.exp(each / T)), 1.0)
    np.testing.assert_allclose(soft(distances, points, T, 0, 1), factors.prod(0), rtol=1e-4, atol=1e-7)


def test_votes_are_the_probability_of_so_many_misses():
    distances, points = seen(), around(100)
    (each, known), p = read(distances, points), 0.0
    hit = np.where(known, 1 / (1 + np.exp(each / T)), 1.0)[:6]  # the others are blind
    for misses in np.ndindex(*[2] * 6):
        if sum(misses) <= 2:
            p = p + np.where(np.array(misses)[:, None], 1 - hit, hit).prod(0)
    np.testing.assert_allclose(soft(distances, points, T, 2), p, rtol=1e-4, atol=1e-6)


def test_on_an_outline_a_view_counts_half():
    # One camera at the origin, the person fills the left half of its image: the outline is at u = 31.5, on the axis.
    K = [[[100.0, 0.0, 31.5], [0.0, 100.0, 23.5], [0.0, 0.0, 1.0]]]
    camera = make_cameras(K, np.eye(3)[None], np.zeros((1, 3)), (64, 48))
    mask = np.zeros((1, 1, 48, 64), bool)
    mask[..., :32] = True
    points = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 5.0], [-0.2, 0.0, 2.0], [0.2, 0.0, 2.0], [0.0, 0.0, -2.0]])
    found = np.asarray(soft(seen(pack_silhouettes(mask), camera), points, T, min_views=1))
    # Ten pixels off, at a depth of 2 m, are 0.2 m, four temperatures; OpenCV's distance is 5 % short.
    np.testing.assert_allclose(found[:2], 0.5, atol=1e-3)
    np.testing.assert_allclose(found[2:4], [1 / (1 + np.exp(-4)), 1 / (1 + np.exp(4))], atol=5e-3)
    assert found[4] == 0.0


@pytest.mark.parametrize("max_misses", [0, 2])
@pytest.mark.parametrize("temperature", [np.float32(1e-3), T, np.float32(0.3)])
def test_larger_silhouettes_never_mean_less_occupancy_and_it_is_a_share(temperature, max_misses):
    masks = unpack_silhouettes(PACKED, 160)
    larger = masks.copy()
    larger[:, :3] |= unpack_silhouettes(film(CAMERAS, [np.array([[0.3, 0.3, 1.2, 0.3]])]), 160)[:, :3]
    points = GRID.centres()
    less, more = (np.asarray(soft(seen(pack_silhouettes(m)), points, temperature, max_misses)) for m in (masks, larger))
    assert (more >= less - 1e-6).all()
    assert (more > 1.2 * less).any()
    assert min(less.min(), more.min()) >= 0.0
    assert max(less.max(), more.max()) <= 1.0


@pytest.mark.parametrize("max_misses", [0, 2])
def test_the_order_of_the_cameras_does_not_matter(max_misses):
    order, points = [3, 0, 5, 1, 4, 2], around(300)
    given = soft(seen(empty_views=[1]), points, T, max_misses)
    other = soft(seen(PACKED[:, order], CAMERAS[order], empty_views=[3]), points, T, max_misses)
    np.testing.assert_allclose(given, other, rtol=1e-4, atol=1e-7)
    assert np.ptp(given) > 0.5


@pytest.mark.parametrize("max_misses", [0, 1])
def test_a_lost_view_is_a_camera_left_out(max_misses):
    others, points = [0, 1, 3, 4, 5], around(300)
    # At a temperature at which no distance is far.
    hot = np.float32(10.0)
    with_lost = soft(seen(empty_views=[2]), points, hot, max_misses)
    without = soft(seen(PACKED[:, others], CAMERAS[others]), points, hot, max_misses)
    np.testing.assert_allclose(with_lost, without, rtol=1e-5)


def test_metres_do_not_depend_on_the_resolution():
    coarse = ring(4)
    K = np.asarray(coarse.K) * [[2.0], [2.0], [1.0]]
    K[:, :2, 2] += 0.5  # the first pixel's centre is at 0 in both
    fine = make_cameras(K, coarse.R, coarse.t, 2 * coarse.size)
    points = around(300)
    one, other = (np.asarray(soft(seen(film(rig, [BALLS]), rig), points, T)) for rig in (coarse, fine))
    np.testing.assert_allclose(one, other, atol=0.15)
    # In pixels the outlines of the finer images would be half as blurred.
    half = np.asarray(soft(seen(film(coarse, [BALLS]), coarse), points, T / 2))
    assert np.abs(one - half).mean() > 3 * np.abs(one - other).mean()


def test_frames_are_vmapped():
    cameras = ring(4)
    two = film(cameras, [BALLS, BALLS + [0.2, 0.0, 0.0, 0.0]])
    points = around(50)
    stack = jax.tree.map(jnp.asarray, silhouette_distances(two, cameras, np.zeros((2, 4), bool)))
    together = jax.jit(jax.vmap(carve_soft, (0, None, None)))(stack, points, T)
    for frame in range(2):
        alone = soft(jax.tree.map(lambda a, f=frame: a[f], stack), points, T)
        np.testing.assert_allclose(together[frame], alone, rtol=1e-5, atol=1e-7)
        np.testing.assert_allclose(soft(stack.of(jnp.asarray(frame)), points, T), alone, rtol=1e-5, atol=1e-7)
    assert np.abs(together[0] - together[1]).max() > 0.3


# Gradients

# Good and bad lenses, and the camera that sees a part only.
SOME = [0, 1, 3, 5]


def unseen_too(count: int) -> np.ndarray:
    """Points around the body, some at and behind cameras, and two that no camera sees."""
    centres = CAMERAS.centres
    return np.concatenate([around(count), centres, 1.3 * centres, [[0.0, 0.0, 40.0], [0.0, 0.0, -40.0]]])


@pytest.mark.slow
def test_gradients_are_finite_differences():
    with jax.enable_x64(True):
        distances, points = (
            in_double(seen(PACKED[:, SOME], CAMERAS[SOME], empty_views=[2])),
            jnp.asarray(unseen_too(12)),
        )

        def fields(d):
            return d.values, d.cameras.K, d.cameras.R, d.cameras.t, d.cameras.dist

        @jax.jit
        def occupancy(points, temperature, *given):
            return carve_soft(eqx.tree_at(fields, distances, given), points, temperature, max_misses=1)

        given = (points, jnp.asarray(0.07), *fields(distances))
        check_grads(occupancy, given, order=1, modes=("fwd", "rev"), eps=1e-7, rtol=1e-4, atol=1e-4)


def test_every_gradient_is_finite_and_what_no_one_sees_has_none():
    points = jnp.asarray(unseen_too(50), jnp.float32)
    distances = jax.tree.map(jnp.asarray, seen(PACKED[:, SOME], CAMERAS[SOME], empty_views=[2]))
    floats, rest = eqx.partition(distances, eqx.is_inexact_array)

    def total(floats, points, temperature):
        return carve_soft(eqx.combine(floats, rest), points, temperature, max_misses=1).sum()

    slopes = jax.jit(jax.grad(total, (0, 1, 2)))
    for temperature in (1e-6, 1e3):
        found = slopes(floats, points, temperature)
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(found))
    of_distances, of_points, _ = slopes(floats, points, 0.05)
    np.testing.assert_array_equal(of_points[-2:], 0.0)
    np.testing.assert_array_equal(of_distances.values[2], 0.0)  # the lost view
    assert (np.abs(of_points[:50]) > 0).any(1).mean() > 0.9
    assert np.abs(of_distances.cameras.t[0]).max() > 0.01
