"""Fisheye lenses: OpenCV's own numbers, laws of projection and rays, and the derivatives of both."""

import cv2
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads
from scipy.spatial.transform import Rotation
from support.fisheyes import BARREL, FISHEYES, FOLDS, by_opencv, cone, fisheye_camera, mixed_ring

from jaxskel import make_cameras
from jaxskel.cameras import apparent_depth, in_cameras, lens_slopes, on_images, project, rays, rays_in_camera

FOLD = np.sqrt(4 / 3)
"""Where `FOLDS` folds back (rad)."""


@pytest.mark.parametrize("skew", [0.0, 12.0])
@pytest.mark.parametrize("lens", FISHEYES)
def test_projection_is_opencvs(lens, skew):
    cameras = fisheye_camera(FISHEYES[lens], skew)
    points = cone(3000, np.radians(89.9))
    u, v, depth = project(cameras, points)
    np.testing.assert_allclose(np.stack([u[0], v[0]], 1), by_opencv(cameras, 0, points), atol=1e-9)
    np.testing.assert_allclose(depth[0], points[:, 2], rtol=1e-12)


def test_projection_by_hand():
    # At 45 degrees the angle is pi / 4, which k1 = 0.1 stretches by 1 + 0.1 * (pi / 4)^2: 3/5 along x, 4/5 along y.
    K = [[[100.0, 8.0, 50.0], [0.0, 200.0, 60.0], [0.0, 0.0, 1.0]]]
    cameras = make_cameras(K, [np.eye(3)], [[0, 0, 0]], (99, 99), [[0.1, 0, 0, 0]], fisheye=True)
    u, v, _ = project(cameras, np.array([[0.6, 0.8, 1.0]]))
    away = np.pi / 4 * (1 + 0.1 * (np.pi / 4) ** 2)
    assert u[0, 0] == pytest.approx(50 + 100 * 0.6 * away + 8 * 0.8 * away, abs=1e-12)
    assert v[0, 0] == pytest.approx(60 + 200 * 0.8 * away, abs=1e-12)


@pytest.mark.parametrize("skew", [0.0, 12.0])
@pytest.mark.parametrize("lens", FISHEYES)
def test_rays_are_opencvs(lens, skew):
    cameras = fisheye_camera(FISHEYES[lens], skew)
    K = np.array(cameras.K[0])
    u, v, _ = project(cameras, cone(3000, np.radians(85)))
    # OpenCV's inverse knows no skew.
    straight = np.stack([u[0] - skew * (v[0] - K[1, 2]) / K[1, 1], v[0]], 1)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-15)
    tangents = cv2.fisheye.undistortPoints(straight[:, None], K, np.array(FISHEYES[lens]), criteria=criteria)[:, 0]
    expected = np.column_stack([tangents, np.ones(len(tangents))])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    found = tangents[:, 0] > -1e5  # OpenCV gives up a few that are near the rim
    assert found.mean() > 0.98
    np.testing.assert_allclose(rays_in_camera(cameras, 0, np.stack([u[0], v[0]], 1))[found], expected[found], atol=1e-9)


@pytest.mark.parametrize("skew", [0.0, -20.0])
@pytest.mark.parametrize("lens", [*FISHEYES, "folds"])
def test_every_pixel_is_seen_where_its_ray_goes_or_not_at_all(lens, skew):
    cameras = fisheye_camera(FISHEYES.get(lens, FOLDS), skew, size=(440, 1000))
    u, v = (a.ravel() for a in np.meshgrid(np.arange(440.0), np.arange(0.0, 1000.0, 3)))
    uv = np.stack([u, v], 1)
    ways = rays(cameras, 0, uv)
    seen = np.isfinite(ways).all(1)
    np.testing.assert_allclose(np.linalg.norm(ways[seen], axis=1), 1.0, rtol=1e-14)
    back = np.stack(project(cameras, 2.0 * ways[seen])[:2], -1)[0]
    np.testing.assert_allclose(back, uv[seen], atol=1e-6)
    # What is not seen is beyond the image of the widest angle that there is.
    limit = FOLD if lens == "folds" else np.pi / 2
    k, K = np.array(FISHEYES.get(lens, FOLDS)), np.asarray(cameras.K[0])
    rim = limit + (k * limit ** np.array([3, 5, 7, 9])).sum()
    yd = (v - K[1, 2]) / K[1, 1]
    away = np.hypot((u - K[0, 2] - skew * yd) / K[0, 0], yd)
    np.testing.assert_array_equal(seen, away < rim)
    assert 0.1 < seen.mean() < 0.999


def test_what_a_fisheye_does_not_see_is_nan():
    angles = np.array([0.0, 1.0, FOLD - 1e-3, FOLD + 1e-3, 1.5, 1.57])
    ways = np.column_stack([np.sin(angles), np.zeros(6), np.cos(angles)])
    behind = np.array([[0.1, 0.1, -1.0], [3.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    for lens, seen in ((FOLDS, [1, 1, 1, 0, 0, 0]), (FISHEYES["mild"], [1] * 6)):
        u, v, _ = project(fisheye_camera(lens, size=(440, 1000)), np.vstack([ways, behind]))
        np.testing.assert_array_equal(np.isfinite(u[0]), np.array([*seen, 0, 0, 0], bool))
        np.testing.assert_array_equal(np.isfinite(v[0]), np.array([*seen, 0, 0, 0], bool))


def test_a_mixed_rig_sees_as_each_of_its_cameras_does():
    rig = mixed_ring()
    points = np.random.default_rng(0).normal([0, 0, 1], 0.5, (300, 3))
    u, v, depth = project(rig, points)
    rng = np.random.default_rng(1)
    which, uv = rng.integers(0, 6, 400), rng.uniform(0, (160, 120), (400, 2))
    together = rays(rig, which, uv)
    for i in range(6):
        alone = rig[[i]]
        for a, b in zip(project(alone, points), (u, v, depth), strict=True):
            np.testing.assert_array_equal(a[0], b[i])
        np.testing.assert_allclose(together[which == i], rays(rig, i, uv[which == i]), atol=1e-12)
        if i % 2:
            assert alone.fisheye is None
            turn, lens = cv2.Rodrigues(np.asarray(rig.R[i]))[0], np.array(BARREL)
            expected = cv2.projectPoints(points, turn, np.asarray(rig.t[i]), np.asarray(rig.K[i]), lens)[0][:, 0]
        else:
            assert alone.are_fisheye.all()
            expected = by_opencv(rig, i, points)
        seen = np.isfinite(u[i])
        assert seen.sum() > 200
        np.testing.assert_allclose(np.stack([u[i], v[i]], 1)[seen], expected[seen], atol=1e-9)


def test_choosing_and_turning_keep_the_lenses():
    rig = mixed_ring()
    np.testing.assert_array_equal(rig[[0, 1, 5, 4]].are_fisheye, [True, False, False, True])
    np.testing.assert_array_equal(rig[2:4].are_fisheye, [True, False])
    np.testing.assert_array_equal(rig.bent, [True] * 6)
    assert fisheye_camera([0.0] * 4).bent.all()
    assert rig[1::2].fisheye is None
    turn = Rotation.from_euler("zyx", (0.4, -1.0, 2.0)).as_matrix()
    points = np.random.default_rng(0).normal([0, 0, 1], 0.4, (50, 3))
    for a, b in zip(project(rig.rotated(turn), points @ turn.T), project(rig, points), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)


def test_jax_and_numpy_agree():
    rig = mixed_ring()
    points = np.vstack([np.random.default_rng(0).normal([0, 0, 1], 0.6, (200, 3)), [[0, 0, 30.0]], rig.centres])
    with jax.enable_x64(True):
        double = jax.jit(project)(jax.tree.map(jnp.asarray, rig), jnp.asarray(points))
    for a, b in zip(double, project(rig, points), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)
    single = jax.jit(project)(rig, jnp.asarray(points[:200], jnp.float32))
    np.testing.assert_allclose(single[0], project(rig, points[:200])[0], atol=1e-3)


@pytest.mark.slow
def test_gradients_are_finite_differences():
    rig = mixed_ring()
    # On the axis of the first camera, hardly off it, where the angle begins to be summed up otherwise, and far off it.
    x = np.array([0.0, 1e-6, 0.0999, 0.1001, 0.5, 4.0])
    on_axis = np.stack([x, 0.3 * x, np.ones(6)], 1) - np.asarray(rig.t[0])
    with jax.enable_x64(True):

        def image(K, R, t, dist, x):
            u, v, depth = project(eqx.tree_at(lambda c: (c.K, c.R, c.t, c.dist), rig, (K, R, t, dist)), x)
            return jnp.nan_to_num(u), jnp.nan_to_num(v), depth

        arguments = tuple(jnp.asarray(a) for a in (rig.K, rig.R, rig.t, rig.dist, on_axis @ np.asarray(rig.R[0])))
        assert np.isfinite(project(rig, np.asarray(arguments[-1]))[0][0]).all()
        check_grads(image, arguments, order=1, modes=("fwd", "rev"), eps=1e-6, atol=1e-4, rtol=1e-5)


def test_slopes_are_the_derivative():
    rig = mixed_ring()
    x, y = np.random.default_rng(0).uniform(-0.6, 0.6, (2, 6, 50))
    x[:, 0], y[:, 0] = 0.0, 0.0
    x[:, 1] *= 0.01
    y[:, 1] *= 0.01
    x[::2, 2] = 8.0
    with jax.enable_x64(True):
        x, y = jnp.asarray(x), jnp.asarray(y)

        def image(x, y):
            return on_images(rig, 2.0 * x, 2.0 * y, jnp.full_like(x, 2.0))

        zero, one = jnp.zeros_like(x), jnp.ones_like(x)
        (u_by_x, v_by_x), (u_by_y, v_by_y) = (
            jax.jvp(image, (x, y), tangent)[1] for tangent in ((one, zero), (zero, one))
        )
        for ours, theirs in zip(lens_slopes(rig, x, y), (u_by_x, u_by_y, v_by_x, v_by_y), strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-8)


def test_what_is_not_seen_does_not_spoil_the_gradient():
    rig = mixed_ring()
    # Behind some cameras, in the centre of one, at right angles to the axis of another.
    beside = rig.centres[2] + 3.0 * np.asarray(rig.R[2])[0]
    points = np.stack([[0.1, 0.0, 1.0], [0.0, 0.0, 30.0], rig.centres[0], beside])

    def seen(cameras, x):
        u, v, _ = project(cameras, x)
        far = apparent_depth(cameras, *in_cameras(cameras, x))
        return jnp.nansum(u + v) + far.sum()

    lens, moved = jax.grad(lambda dist, x: seen(eqx.tree_at(lambda c: c.dist, rig, dist), x), argnums=(0, 1))(
        jnp.asarray(rig.dist, jnp.float32), jnp.asarray(points, jnp.float32)
    )
    assert np.isfinite(lens).all()
    assert np.isfinite(moved).all()
    # The tangential coefficients of an ordinary lens are k3 and k4 of a fisheye; its others are unused.
    assert (np.asarray(lens)[:, :4] != 0).all()
    np.testing.assert_array_equal(np.asarray(lens)[::2, 4:], 0.0)


def test_a_fisheye_is_as_far_away_as_its_distance():
    # A ball of 10 cm at 2 m shows 60 * 0.1 / 2 = 3 px anywhere in the image of an equidistant lens, along the radius.
    lens = fisheye_camera([0.0] * 4)
    for angle in np.radians([0.0, 40.0, 80.0]):
        middle = 2 * np.array([np.sin(angle), 0.0, np.cos(angle)])
        beside = middle + 1e-4 * np.array([np.cos(angle), 0.0, -np.sin(angle)])
        u, _, _ = project(lens, np.stack([middle, beside]))
        far = apparent_depth(lens, *in_cameras(lens, middle[None]))[0, 0]
        assert far == pytest.approx(2.0, rel=1e-12)
        assert (u[0, 1] - u[0, 0]) * far / 300.0 == pytest.approx(1e-4, rel=1e-6)


def spoilt(**changes):
    """Two good cameras, `left` ordinary and `right` a fisheye, with something changed."""
    K = np.tile([[300.0, 0, 320], [0, 300, 240], [0, 0, 1]], (2, 1, 1))
    good = {"K": K, "R": np.tile(np.eye(3), (2, 1, 1)), "t": np.zeros((2, 3)), "size": (640, 480)}
    dist = [[-0.2, 0.1, 0.001, 0.002, 0.01], [0.08, -0.05, 0.02, -0.004, 0.0]]
    return good | {"dist": dist, "names": ["left", "right"], "fisheye": [False, True]} | changes


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"dist": [[0.0] * 5, [0.1, 0, 0, 0, 0.01]]}, r"camera right .*a fisheye lens has four coefficients"),
        ({"dist": [[0.0] * 4, [0.1, 0, np.nan, 0]]}, r"camera right .*dist holds NaN"),
        ({"dist": [[0.0] * 4, FOLDS]}, r"camera right .*folds its image at 66 degrees to its axis, 231 px"),
        ({"dist": [[0.0] * 4, [-1e300, 0, 0, 1e300]]}, r"camera right .*folds its image at 0 degrees"),
        ({"fisheye": [False]}, "fisheye: give true or false, for all or for each of 2 cameras"),
        ({"fisheye": ["no", "yes"]}, "fisheye: give true or false"),
        ({"fisheye": 1}, "fisheye: give true or false"),
    ],
)
def test_fisheyes_that_are_none(changes, says):
    assert make_cameras(**spoilt()).are_fisheye.tolist() == [False, True]
    with pytest.raises(ValueError, match=says) as refusal:
        make_cameras(**spoilt(**changes))
    assert "left" not in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_lens_that_folds_beyond_its_image_is_taken():
    # It shows what is within 66 degrees, up to the upper and lower edge; the second folds where lenses usually end.
    assert fisheye_camera(FOLDS, size=(640, 440)).are_fisheye.all()
    assert fisheye_camera([-0.14, 0, 0, 0]).are_fisheye.all()


def test_rigs_without_a_fisheye_are_what_they_were():
    given = spoilt(fisheye=False)
    assert make_cameras(**given).fisheye is None
    del given["fisheye"]
    assert jax.tree.structure(make_cameras(**given)) == jax.tree.structure(make_cameras(**spoilt(fisheye=False)))
    assert len(jax.tree.leaves(make_cameras(**given))) == 6
