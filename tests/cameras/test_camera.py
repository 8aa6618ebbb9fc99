import cv2
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads
from scipy.spatial.transform import Rotation

from jaxskel.cameras import Cameras, in_cameras, lens_slopes, make_cameras, on_images, project, rays

# Lenses of real cameras; the barrel folds back at the tangent 1 / sqrt(3 * 0.36) = 0.962.
LENSES = {
    "none": [0.0, 0.0, 0.0, 0.0],
    "four": [-0.2, 0.08, 0.001, -0.002],
    "barrel": [-0.36, 0.0, 0.0, 0.0],
    "five": [0.12, -0.05, 0.003, 0.001, 0.02],
    "eight": [0.3, 0.1, -0.001, 0.002, 0.02, 0.55, 0.2, 0.04],
}
FOLD = 1 / np.sqrt(3 * 0.36)


def camera(lens="none", skew=0.0, size=(640, 480)) -> Cameras:
    K = np.array([[410.0, skew, 322.3], [0.0, 405.0, 236.1], [0.0, 0.0, 1.0]])
    R = Rotation.from_euler("xyz", (105.0, 4.0, 35.0), degrees=True).as_matrix()
    return make_cameras(K[None], R[None], [[0.1, 0.9, 3.0]], size, [LENSES[lens]], ["left"])


def seen_points(cameras: Cameras, count=200, widest=0.6) -> np.ndarray:
    """Points in front of camera 0, in a square cone whose corner has the tangent 1.41 times `widest`."""
    rng = np.random.default_rng(3)
    depth = rng.uniform(0.5, 6.0, (count, 1))
    x_cam = np.hstack([rng.uniform(-widest, widest, (count, 2)) * depth, depth])
    return (x_cam - cameras.t[0]) @ cameras.R[0]


@pytest.mark.parametrize("lens", LENSES)
def test_project_is_opencvs(lens):
    cameras = camera(lens)
    points = seen_points(cameras)
    u, v, depth = project(cameras, points)
    expected, _ = cv2.projectPoints(
        points, cv2.Rodrigues(cameras.R[0])[0], cameras.t[0], cameras.K[0], np.array(LENSES[lens])
    )
    np.testing.assert_allclose(np.stack([u[0], v[0]], -1), expected[:, 0], atol=1e-6)
    np.testing.assert_allclose(depth[0], (points @ cameras.R[0].T + cameras.t[0])[:, 2], rtol=1e-12)


def test_project_with_skew_by_hand():
    # The tangents are 0.5 and -0.25: u = 100 * 0.5 + 8 * -0.25 + 50 = 98, v = 200 * -0.25 + 60 = 10.
    cameras = make_cameras(
        [[[100.0, 8.0, 50.0], [0.0, 200.0, 60.0], [0.0, 0.0, 1.0]]], [np.eye(3)], [[0, 0, 0]], (99, 99)
    )
    u, v, depth = project(cameras, np.array([[1.0, -0.5, 2.0]]))
    np.testing.assert_allclose([u[0, 0], v[0, 0], depth[0, 0]], [98.0, 10.0, 2.0], rtol=1e-14)
    # With k1 = 0.1 both tangents grow by 1 + 0.1 * 0.3125.
    lens = eqx.tree_at(lambda c: c.dist, cameras, np.array([[0.1, 0, 0, 0, 0, 0, 0, 0]]))
    u, v, _ = project(lens, np.array([[1.0, -0.5, 2.0]]))
    np.testing.assert_allclose([u[0, 0], v[0, 0]], [50 + 48 * 1.03125, 60 - 50 * 1.03125], rtol=1e-14)


@pytest.mark.parametrize("skew", [0.0, 30.0])
@pytest.mark.parametrize("lens", LENSES)
def test_rays_undo_project(lens, skew):
    cameras = camera(lens, skew)
    points = seen_points(cameras)
    u, v, _ = project(cameras, points)
    directions = points - cameras.centres[0]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_allclose(rays(cameras, 0, np.stack([u[0], v[0]], -1)), directions, atol=1e-9)


def test_rays_of_several_cameras_at_once_are_those_of_each():
    singles = [camera(lens, skew) for lens, skew in (("barrel", 0.0), ("none", 30.0), ("eight", 5.0))]
    K, R, dist = (np.concatenate([getattr(single, name) for single in singles]) for name in ("K", "R", "dist"))
    R[1] = R[1] @ Rotation.from_euler("z", 50.0, degrees=True).as_matrix()
    rig = make_cameras(K, R, np.zeros((3, 3)), (640, 480), dist)
    rng = np.random.default_rng(1)
    index, uv = rng.integers(0, 3, 60), rng.uniform(0, (640, 480), (60, 2))
    together = rays(rig, index, uv)
    assert 0 < np.isnan(together).any(1).sum() < 30  # corners of the barrel
    for which in range(3):
        np.testing.assert_allclose(together[index == which], rays(rig, which, uv[index == which]), atol=1e-12)


def test_points_that_a_camera_cannot_see_are_nan():
    cameras = camera("barrel")
    tangents = np.array([0.0, 0.9, FOLD - 0.01, FOLD + 0.01, 1.6, 30.0])
    x_cam = np.column_stack([tangents, np.zeros(6), np.ones(6)]) * 2.0
    points = (np.vstack([x_cam, [[0.1, 0.1, -2.0], [0.0, 0.0, 0.0]]]) - cameras.t[0]) @ cameras.R[0]
    u, v, _ = project(cameras, points)
    seen = np.array([True, True, True, False, False, False, False, False])
    np.testing.assert_array_equal(np.isfinite(u[0]), seen)
    np.testing.assert_array_equal(np.isfinite(v[0]), seen)
    # The trap: OpenCV folds the point at the tangent 1.6, far outside, into the middle of the image.
    folded, _ = cv2.projectPoints(
        points[4:5], cv2.Rodrigues(cameras.R[0])[0], cameras.t[0], cameras.K[0], cameras.dist[0]
    )
    assert (folded[0, 0] > 0).all()
    assert (folded[0, 0] < cameras.size[0]).all()


def test_rays_beyond_the_fold_are_nan():
    cameras = camera("barrel")
    # Distorted radii end at 0.962 * (1 - 0.36 * 0.962^2) = 0.6415.
    uv = cameras.K[0, :2, 2] + 410.0 * np.array([[0.62, 0.0], [0.66, 0.0], [2.0, 0.0]])
    np.testing.assert_array_equal(np.isfinite(rays(cameras, 0, uv)).all(1), [True, False, False])


@pytest.mark.parametrize("lens", LENSES)
def test_jax_and_numpy_agree(lens):
    cameras, beyond = camera(lens, skew=5.0), np.array([[90.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    points = np.vstack([seen_points(cameras), (beyond - cameras.t[0]) @ cameras.R[0]])
    with jax.enable_x64(True):
        ours = jax.jit(project)(jax.tree.map(jnp.asarray, cameras), jnp.asarray(points))
    for a, b in zip(ours, project(cameras, points), strict=True):
        assert isinstance(a, jax.Array)
        np.testing.assert_allclose(a[:, :-2], b[:, :-2], rtol=1e-10)
        # 89 degrees off the axis, a lens amplifies rounding errors.
        np.testing.assert_allclose(a, b, rtol=1e-5)
    single = jax.jit(project)(cameras, jnp.asarray(points[:-2], jnp.float32))
    np.testing.assert_allclose(single[0], project(cameras, points[:-2])[0], atol=0.02)


@pytest.mark.parametrize("lens", ["none", "barrel", "eight"])
def test_gradient_is_the_finite_difference(lens):
    cameras = camera(lens, skew=5.0)
    points = seen_points(cameras, 6)

    with jax.enable_x64(True):

        @jax.jit
        def image(K, R, t, x):
            moved = eqx.tree_at(lambda c: (c.K, c.R, c.t), cameras, (K, R, t))
            u, v, _ = project(moved, x)
            return u, v

        arguments = tuple(jnp.asarray(a) for a in (cameras.K, cameras.R, cameras.t, points))
        check_grads(image, arguments, order=1, modes=("fwd", "rev"), eps=1e-5, atol=1e-4, rtol=1e-6)


@pytest.mark.parametrize("lens", LENSES)
def test_slopes_of_the_lens_are_its_derivative(lens):
    cameras = camera(lens, skew=5.0)
    depth = 2.0
    with jax.enable_x64(True):
        right, low, ahead = (jnp.asarray(a) for a in in_cameras(cameras, seen_points(cameras)))
        x, y = right / ahead, low / ahead

        def image(x, y):
            return on_images(cameras, depth * x, depth * y, jnp.full_like(x, depth))

        zero, one = jnp.zeros_like(x), jnp.ones_like(x)
        (u_by_x, v_by_x), (u_by_y, v_by_y) = (
            jax.jvp(image, (x, y), tangent)[1] for tangent in ((one, zero), (zero, one))
        )
        for ours, theirs in zip(lens_slopes(cameras, x, y), (u_by_x, u_by_y, v_by_x, v_by_y), strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-7)


def test_an_unseen_point_does_not_spoil_the_gradient():
    cameras = camera("barrel")
    beyond = (np.array([[90.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]) - cameras.t[0]) @ cameras.R[0]

    def seen(x):
        u, v, _ = project(cameras, x)
        return jnp.nansum(u + v)

    gradient = jax.grad(seen)(jnp.asarray(np.vstack([seen_points(cameras, 2), beyond]), jnp.float32))
    assert np.isfinite(gradient).all()
    assert (gradient[:2] != 0).any()
    np.testing.assert_array_equal(gradient[2:], 0.0)


def test_a_rotated_rig_sees_the_rotated_world():
    cameras, turn = camera("four"), Rotation.from_euler("zyx", (0.4, -1.0, 2.0)).as_matrix()
    points = seen_points(cameras)
    for a, b in zip(project(cameras.rotated(turn), points @ turn.T), project(cameras, points), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)
    np.testing.assert_allclose(cameras.rotated(turn).centres, cameras.centres @ turn.T, atol=1e-12)


@pytest.mark.parametrize("lens", LENSES)
def test_a_reduced_camera_sees_the_pixel_that_holds_the_pixel(lens):
    whole = camera(lens, size=(641, 480))
    points = seen_points(whole)
    reduced = whole.reduced(np.full(len(whole), 8))
    np.testing.assert_array_equal(reduced.size, [[81, 60]] * len(whole))
    for fine, coarse in zip(project(whole, points)[:2], project(reduced, points)[:2], strict=True):
        # The centre of the first pixel is 0.
        np.testing.assert_allclose(coarse, (fine + 0.5) / 8 - 0.5, atol=1e-6)


def test_choosing_cameras():
    rng = np.random.default_rng(0)
    R = Rotation.random(4, rng).as_matrix()
    sizes = np.array([[100, 80], [200, 160], [300, 240], [400, 320]])
    rig = make_cameras(
        np.tile(np.diag([50.0, 50, 1]), (4, 1, 1)), R, rng.normal(size=(4, 3)), sizes, np.arange(16).reshape(4, 4) / 99
    )
    chosen = rig[[3, 1]]
    assert chosen.names == ("cam3", "cam1")
    points = rng.normal(size=(50, 3))
    for a, b in zip(project(chosen, points), project(rig, points), strict=True):
        np.testing.assert_array_equal(a, b[[3, 1]])
    np.testing.assert_array_equal(chosen.size, sizes[[3, 1]])
    assert rig[1:3].names == ("cam1", "cam2")
    np.testing.assert_allclose(np.einsum("cij,cj->ci", R, rig.centres) + rig.t, 0.0, atol=1e-12)


def changed(field, index, value):
    """Two good cameras, `left` and `right`, with one entry of the second one spoiled."""
    K, R, t = np.tile(np.diag([400.0, 400.0, 1.0]), (2, 1, 1)), np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3))
    arrays = {"K": K, "R": R, "t": t, "dist": np.zeros((2, 5)), "size": np.full((2, 2), 480.0)}
    arrays[field][(1, *index)] = value
    return arrays | {"names": ["left", "right"]}


@pytest.mark.parametrize(
    ("field", "index", "value", "complaint"),
    [
        ("K", (1, 0), 5.0, "upper triangular"),
        ("K", (2, 0), 0.1, "upper triangular"),
        ("K", (2, 2), 0.0, "upper triangular"),
        ("K", (0, 0), -400.0, "focal lengths"),
        ("K", (1, 1), 0.0, "focal lengths"),
        ("K", (0, 2), np.nan, "K holds NaN"),
        ("R", (), 2 * np.eye(3), "not a rotation"),
        ("R", (0, 1), 0.1, "not a rotation"),
        ("R", (), np.diag([1.0, 1.0, -1.0]), "mirror"),
        ("R", (0, 0), np.inf, "R holds NaN or infinity"),
        ("t", (2,), 3500.0, "millimetres"),
        ("t", (2,), np.nan, "t holds NaN"),
        ("dist", (4,), np.nan, "dist holds NaN"),
        ("size", (1,), 0, "1 to 65536"),
        ("size", (0,), 640.5, "1 to 65536"),
        ("size", (0,), np.nan, "1 to 65536"),
    ],
)
def test_refusals_name_the_camera(field, index, value, complaint):
    make_cameras(**changed("t", (0,), 1.0))
    with pytest.raises(ValueError, match=complaint) as refusal:
        make_cameras(**changed(field, index, value))
    assert "right" in str(refusal.value)
    assert "left" not in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("spoiled", "complaint"),
    [
        ({"K": np.eye(3)}, "K has shape"),
        ({"K": np.zeros((0, 3, 3))}, "K has shape"),
        ({"K": "focal"}, "K is not an array of numbers"),
        ({"R": np.zeros((2, 3))}, "R has shape"),
        ({"t": np.zeros((3, 3))}, "t has shape"),
        ({"size": [640.0]}, "size has shape"),
        ({"dist": np.zeros((2, 14))}, "dist has shape"),
        ({"names": ["a", "a"]}, "different camera names"),
        ({"names": ["a"]}, "different camera names"),
    ],
)
def test_refusals_of_wrong_shapes(spoiled, complaint):
    with pytest.raises(ValueError, match=complaint):
        make_cameras(**(changed("t", (0,), 1.0) | spoiled))
