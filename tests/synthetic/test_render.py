import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from jaxskel.body import default_adult, place_body
from jaxskel.cameras import make_cameras, project, rays
from jaxskel.recording import unpack_silhouettes
from jaxskel.synthetic import demo_motion, detailed_body, look_at, make_view, render, render_view


def one_camera(centre, target, focal=260.0, size=(320, 240), skew=0.0, dist=None):
    R, t = look_at(np.array(centre, float), np.array(target, float))
    K = np.array([[focal, skew, size[0] / 2], [0, focal * 1.02, size[1] / 2], [0, 0, 1]])
    return make_cameras(K[None], R[None], t[None], size, None if dist is None else np.array([dist]))


CAMERAS = {
    "pinhole": one_camera((3.0, 1.0, 1.4), (0, 0, 1.0)),
    "skew": one_camera((3.0, -1.0, 0.4), (0, 0, 1.0), skew=40.0),
    "barrel": one_camera((2.0, 0.5, 2.0), (0, 0, 0.9), 190.0, dist=[-0.28, 0.09, 0.002, -0.003, -0.01]),
    "pincushion": one_camera((-3.0, 0.5, 2.0), (0, 0, 0.9), dist=[0.2, 0.05, 0, 0]),
    "rational": one_camera((0.2, 3.0, 1.2), (0, 0, 1.0), dist=[0.3, 0.1, 0, 0.002, 0.02, 0.55, 0.2, 0.04]),
    "partly outside": one_camera((1.6, 0.0, 1.4), (0, 0.5, 1.5), 200.0),
    "from above": one_camera((0.3, 0.1, 4.0), (0, 0, 1.0), 300.0),
}


def sample_capsules(ends, radii, count, rng):
    """Points in tapered capsules, half of them on the balls' surfaces."""
    s = rng.uniform(size=(count, len(ends), 1))
    centres = ends[:, 0] + s * (ends[:, 1] - ends[:, 0])
    directions = rng.normal(size=centres.shape)
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    depth = np.where(rng.uniform(size=s.shape) < 0.5, 1.0, rng.uniform(size=s.shape) ** (1 / 3))
    radius = radii[:, :1] + s * (radii[:, 1:] - radii[:, :1])
    return (centres + depth * radius * directions).reshape(-1, 3)


@pytest.fixture(scope="module")
def adult():
    return default_adult(1.75)


@pytest.fixture(scope="module")
def motion(adult):
    return demo_motion(adult, 120, 10.0)


def test_ball_is_the_analytic_disk():
    cameras = make_cameras(
        np.array([[[200.0, 0, 40], [0, 200.0, 30], [0, 0, 1]]]), np.eye(3)[None], np.zeros((1, 3)), (80, 60)
    )
    ball = np.array([[[0.0, 0.0, 5.0], [0.0, 0.0, 5.0]]])
    mask = render_view(make_view(cameras, 0), ball, np.array([[0.4, 0.4]]))
    # The tangent cone of the ball has the sine 0.4 / 5.
    radius = 200 * 0.4 / np.sqrt(5**2 - 0.4**2)
    v, u = np.mgrid[:60, :80]
    np.testing.assert_array_equal(mask, (u - 40) ** 2 + (v - 30) ** 2 <= radius**2)
    assert mask.sum() == 805


def test_cylinder_along_the_image_has_straight_edges():
    cameras = make_cameras(
        np.array([[[100.0, 0, 50], [0, 100.0, 50], [0, 0, 1]]]), np.eye(3)[None], np.zeros((1, 3)), (101, 101)
    )
    mask = render_view(make_view(cameras, 0), np.array([[[-9.0, 0, 2], [9.0, 0, 2]]]), np.array([[0.3, 0.3]]))
    # Tangent planes through the x axis: tan(asin(0.3 / 2)) * 100 = 15.17 px.
    rows = np.flatnonzero(mask.any(1))
    assert (rows[0], rows[-1]) == (35, 65)
    assert mask[35:66].all()


@pytest.mark.parametrize("name", CAMERAS)
def test_silhouette_is_the_projection_of_the_body(name, adult, motion):
    cameras, rng = CAMERAS[name], np.random.default_rng(1)
    ends, radii = place_body(detailed_body(adult), motion)
    for frame in (0, 37, 87, 100):
        mask = render_view(make_view(cameras, 0), ends[frame], radii)
        u, v, _ = (np.asarray(x)[0] for x in project(cameras, sample_capsules(ends[frame], radii, 8000, rng)))
        u, v = np.round(u[~np.isnan(u)]).astype(int) + 1, np.round(v[~np.isnan(v)]).astype(int) + 1
        # With one pixel around the image.
        inside = (u >= 0) & (u < 322) & (v >= 0) & (v < 242)
        projected = np.zeros((242, 322), bool)
        projected[v[inside], u[inside]] = True
        near = np.ones((3, 3), bool)
        assert mask.sum() > 1000
        assert not (projected[1:-1, 1:-1] & ~binary_dilation(mask, near)).any()
        assert not (mask & ~binary_dilation(projected, near)[1:-1, 1:-1]).any()


def test_capsules_around_the_camera_against_brute_force():
    rng = np.random.default_rng(2)
    cameras = one_camera((0, 0, 0), (1, 0, 0), focal=8.0, size=(40, 30))
    view = make_view(cameras, 0)
    v, u = np.mgrid[:30, :40]
    directions = rays(cameras, 0, np.stack([u.ravel(), v.ravel()], -1).astype(float))
    s = np.linspace(0, 1, 501)[:, None]
    seen = []
    for _ in range(80):
        ends, radii = rng.uniform(-1.5, 1.5, (2, 3)), rng.uniform(0.02, 0.6, 2)
        points, radius = ends[0] + s * (ends[1] - ends[0]), (radii[0] + s * (radii[1] - radii[0]))[:, 0]
        along = np.maximum(directions @ points.T, 0.0)
        distance = np.linalg.norm(points[None] - along[..., None] * directions[:, None], axis=-1)
        gap = (distance - radius).min(-1).reshape(30, 40)
        mask = render_view(view, ends[None], radii[None])
        np.testing.assert_array_equal(mask[np.abs(gap) > 2e-3], (gap < 0)[np.abs(gap) > 2e-3])
        seen.append(mask.mean())
    # The cases must span nothing, part and all of the image.
    assert min(seen) == 0
    assert max(seen) == 1
    assert sum(0 < x < 1 for x in seen) > 20


def test_where_the_lens_sees_nothing_is_no_person():
    cameras = one_camera((2, 0, 1), (0, 0, 1), focal=60.0, dist=[-0.3, 0, 0, 0])
    view = make_view(cameras, 0)
    blind = np.isnan(view.directions[0])
    assert blind.any()
    around_the_camera = np.array([[[2.0, 0, 1], [2.0, 0, 1]]])
    mask = render_view(view, around_the_camera, np.array([[0.5, 0.5]]))
    np.testing.assert_array_equal(mask, ~blind)


def test_images_of_different_sizes_are_padded(adult):
    small = one_camera((3.0, 1.0, 1.4), (0, 0, 1.0), 60.0, (51, 77))
    large = one_camera((1.0, 3.0, 1.4), (0, 0, 1.0), 80.0, (120, 60))
    fields = {name: np.concatenate([getattr(small, name), getattr(large, name)]) for name in ("K", "R", "t", "size")}
    ends, radii = place_body(detailed_body(adult), demo_motion(adult, 1))
    done = []
    packed = render(make_cameras(**fields), ends, radii, done.append)
    masks = unpack_silhouettes(packed, 120)
    assert masks.shape == (1, 2, 77, 120)
    assert done == [1]
    for index, camera in enumerate((small, large)):
        width, height = camera.size[0]
        alone = render_view(make_view(camera, 0), ends[0], radii)
        assert alone.any()
        np.testing.assert_array_equal(masks[0, index, :height, :width], alone)
        masks[0, index, :height, :width] = False
    assert not masks.any()
