"""Views through fisheye lenses beside ordinary ones: their hulls, outlines, rigs and poses."""

from dataclasses import replace

import cv2
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads
from support.checkerboards import BOARD, lenses, off, pictures
from support.checkerboards import rig as board_rig
from support.fisheyes import FISHEYES, by_opencv, fisheye_camera, mixed_ring
from support.optimisations import optimised
from support.perturbed_rigs import body, perturbed
from support.phantoms import film
from support.recordings import with_known_body

from jaxskel import Cameras, Recording, make_cameras, reconstruct, refine_cameras
from jaxskel.camera_calibration.from_boards import calibrate_cameras, camera_pose
from jaxskel.cameras import compare_rigs, project
from jaxskel.hull import agreement, carve, carve_soft, make_grid, projection_table, reproject
from jaxskel.io.calibrations import read_calibration, write_pose2sim_calibration
from jaxskel.outlines import SilhouetteDistances, contours, silhouette_distances
from jaxskel.synthetic import camera_ring, make_scene
from jaxskel.visualization import draw_skeleton
from jaxskel.visualization.report._overlays import drawn_skeletons

pytestmark = pytest.mark.slow

SIZE = (240, 200)
GRID = make_grid(np.array([-0.6, -1.1, -0.1]), np.array([0.8, 0.8, 2.1]), 0.04)
NOBODY_LOST = np.zeros((1, 6), bool)


@pytest.fixture(scope="module")
def cameras() -> Cameras:
    """Six views, every second a fisheye, so near that a person fills them."""
    return mixed_ring(6, SIZE, 90.0)


@pytest.fixture(scope="module")
def packed(cameras) -> np.ndarray:
    return film(cameras, [body(0)])


def test_voxels_fall_on_the_pixels_that_opencv_says(cameras):
    table = projection_table(cameras, GRID, SIZE[1], SIZE[0])
    for view in (0, 2, 4):
        u, v = np.floor(by_opencv(cameras, view, GRID.centres()).T + 0.5)
        in_front = GRID.centres() @ np.asarray(cameras.R[view])[2] + cameras.t[view, 2] > 0
        seen = in_front & (u >= 0) & (v >= 0) & (u < SIZE[0]) & (v < SIZE[1])
        assert 0.8 < seen.mean() <= 1
        np.testing.assert_array_equal(table.pixels[view], np.where(seen, v * SIZE[0] + u, table.unseen))


def test_the_hull_contains_the_body_and_covers_the_silhouettes(cameras, packed):
    hulls = carve(packed, projection_table(cameras, GRID, SIZE[1], SIZE[0]))
    balls = body(0)
    depth = (balls[:, 3] - np.linalg.norm(GRID.centres()[:, None] - balls[:, :3], axis=-1)).max(1).reshape(GRID.shape)
    hull = hulls.dense(0)
    assert (depth > 0.04).sum() > 50
    assert hull[depth > 0.04].all()
    assert not hull[depth < -0.3].any()
    masks = np.unpackbits(packed, axis=-1)[0].astype(bool)
    found = agreement(reproject(hulls, 0, cameras, SIZE[1], SIZE[0]), masks)
    assert found.coverage.min() > 0.97
    # Voxels are as wide as arms, so they stick out; in views through ordinary lenses they do so as well.
    assert found.spill[::2].max() < found.spill[1::2].max()


def distances(cameras: Cameras, packed: np.ndarray) -> SilhouetteDistances:
    found = silhouette_distances(packed, cameras, np.zeros((1, len(cameras)), bool))
    return jax.tree.map(lambda a: jnp.asarray(a)[0], found)


def test_distances_are_metres_far_off_the_axis_too():
    # A ball of 15 cm at 1.5 m, 50 degrees off the axis of a fisheye, and points 18 cm from its middle, across the view.
    lens = fisheye_camera(FISHEYES["equidistant"], size=(700, 480))
    angle = np.radians(50.0)
    way, out = np.array([np.sin(angle), 0, np.cos(angle)]), np.array([np.cos(angle), 0, -np.sin(angle)])
    rig = make_cameras(lens.K, lens.R, lens.t, lens.size, lens.dist[:, :4], fisheye=True)
    found = distances(rig, film(rig, [np.array([[*(1.5 * way), 0.15]])]))
    points = jnp.asarray(np.stack([1.5 * way, 1.5 * way + 0.18 * out, 1.5 * way - 0.18 * out]), jnp.float32)
    # Its outline is 0.1002 rad from the middle and the points 0.1194 rad: 0.0192 rad at 1.51 m are 29 mm.
    np.testing.assert_allclose(found.at(points)[0], [-0.15, 0.029, 0.029], atol=0.013)
    np.testing.assert_allclose(found.at(points)[0, 1:], 0.029, atol=0.004)


def test_the_gradient_is_that_of_the_interpolated_distance(cameras, packed):
    found = distances(cameras, packed)
    points = jnp.asarray(np.random.default_rng(0).normal([0, 0, 1.0], 0.4, (60, 3)), jnp.float32)
    points = points.at[0].set(jnp.array([0.0, 0.0, 40.0]))
    value, gradient = eqx.filter_jit(SilhouetteDistances.with_gradient)(found, points)
    expected, change = jax.linearize(found.at, points)
    np.testing.assert_allclose(value, expected, atol=1e-6)
    assert np.abs(gradient[0]).max() > 0.5
    for axis, ours in enumerate(gradient):
        np.testing.assert_allclose(ours, change(jnp.zeros_like(points).at[:, axis].set(1.0)), atol=5e-4)


def test_soft_carving_has_the_gradient_of_the_lenses(cameras, packed):
    found, rng = distances(cameras, packed), np.random.default_rng(1)
    with jax.enable_x64(True):
        double = jax.tree.map(lambda a: jnp.asarray(a, float) if a.dtype.kind == "f" else a, found)
        points = jnp.asarray(body(0)[::6, :3] + rng.normal(0, 0.05, (8, 3)))

        def occupancy(points, dist):
            return carve_soft(eqx.tree_at(lambda d: d.cameras.dist, double, dist), points, 0.05)

        dist = jnp.asarray(double.cameras.dist)
        assert 0.05 < float(occupancy(points, dist).mean()) < 0.95
        check_grads(occupancy, (points, dist), order=1, modes=("rev",), eps=1e-7, atol=1e-4, rtol=1e-3)


def test_rays_of_outlines_go_through_the_outlines(cameras, packed):
    found = contours(packed, cameras, NOBODY_LOST, 600)
    assert np.isfinite(found.directions).all()
    for view in range(6):
        own = np.linalg.norm(np.asarray(found.centres[0]) - cameras.centres[view], axis=1) < 1e-5
        points = np.asarray(found.centres[0] + 1.7 * found.directions[0], np.float64)[own]
        uv = np.stack(project(cameras, points)[:2], -1)[view]
        # One coordinate is whole, the other half-way between two pixels.
        np.testing.assert_allclose(2 * uv, np.round(2 * uv), atol=5e-3)
        assert own.sum() == 100


def test_a_wide_image_has_outlines_only_where_the_lens_sees():
    # A ring of balls around the axis: the outer ones are beyond 90 degrees in an image of 110 to each side.
    K = [[[100.0, 0, 200], [0, 100, 200], [0, 0, 1]]]
    lens = make_cameras(K, [np.eye(3)], np.zeros((1, 3)), (401, 401), np.zeros((1, 4)), fisheye=True)
    mask = np.zeros((401, 401), np.uint8)
    cv2.circle(mask, (200, 200), 170, (1,), 40)
    found = contours(np.packbits(mask, axis=-1)[None, None], lens, np.zeros((1, 1), bool), 500)
    away = np.arccos(np.asarray(found.directions)[0, :, 2])
    assert np.isfinite(away).all()
    np.testing.assert_allclose(
        away, 1.50, atol=0.02
    )  # the inner outline is at 150 px; the outer one at 190 is not seen


def test_a_wrong_rig_comes_back(cameras):
    bodies = [body(seed) for seed in range(10)]
    four = cameras[[0, 1, 2, 3]]
    seen = Recording(four, film(four, bodies), 25.0, "+Z", np.arange(10))
    wrong = perturbed_with_lenses(four, 7)
    with optimised():
        refined = refine_cameras(replace(seen, cameras=wrong))
    before, after = (np.degrees(compare_rigs(rig, four).angles) for rig in (wrong, refined.cameras))
    assert before.max() > 0.4
    assert after.max() < 0.25
    assert after.mean() < 0.4 * before.mean()
    np.testing.assert_array_equal(refined.cameras.are_fisheye, [True, False, True, False])


def perturbed_with_lenses(cameras: Cameras, seed: int) -> Cameras:
    moved = perturbed(make_cameras(cameras.K, cameras.R, cameras.t, cameras.size), seed)
    return eqx.tree_at(lambda c: (c.R, c.t), cameras, (moved.R, moved.t))


def test_skeletons_are_drawn_where_the_lens_shows_them(cameras):
    joints = np.random.default_rng(0).normal([0, 0, 1.0], 0.2, (1, 20, 3))
    straight = eqx.tree_at(lambda c: c.fisheye, cameras, np.zeros(6, bool))
    drawn, other = (drawn_skeletons(rig, joints) for rig in (cameras, straight))
    assert (drawn[0, ::2] != other[0, ::2]).any()
    image = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    draw_skeleton(image, cameras, 2, joints[0, :15])
    for column, row in np.round(by_opencv(cameras, 2, joints[0, :15])).astype(int):
        if 0 <= column < SIZE[0] and 0 <= row < SIZE[1]:
            assert image[row, column].any()


def wide_board_rig() -> Cameras:
    """The cameras of the boards, with fisheye lenses, one of them with skew."""
    rig = board_rig()
    K = np.array(rig.K)
    K[1, 0, 1] = 6.0
    return make_cameras(K, rig.R, rig.t, rig.size, list(FISHEYES.values())[1:], rig.names, fisheye=True)


def test_a_board_tells_where_fisheye_cameras_are(tmp_path):
    rig = wide_board_rig()
    given = {name: replace(lens, fisheye=True) for name, lens in lenses(rig).items()}
    u, v, _ = (np.asarray(a) for a in project(rig, BOARD.points))
    for i, lens in enumerate(given.values()):
        R, t, rms = camera_pose(np.stack([u[i], v[i]], 1), BOARD, lens.K, lens.dist, fisheye=True)
        assert rms < 1e-5
        np.testing.assert_allclose(R, rig.R[i], atol=1e-6)
        np.testing.assert_allclose(t, rig.t[i], atol=1e-6)
    found = calibrate_cameras(pictures(tmp_path, rig, BOARD), BOARD, given)
    angle, distance = off(found.cameras, rig)
    assert angle < 0.1
    assert distance < 0.003
    write_pose2sim_calibration(tmp_path / "Calib.toml", found.cameras)
    assert read_calibration(tmp_path / "Calib.toml").cameras.are_fisheye.all()
    with pytest.raises(ValueError, match="corners of the board are where its fisheye lens shows nothing"):
        camera_pose(
            np.stack([u[0], v[0]], 1) + 900.0, BOARD, np.asarray(rig.K[0]), np.array([-0.25, 0, 0, 0]), fisheye=True
        )


def near_ring(lens: list[float] | None) -> Cameras:
    """Eight views from 2 m, of the same scale at the middle of the image, as large as those of `test_pipeline`."""
    rig = camera_ring(8, 2.0, (640, 480))
    K = np.tile([[156.0, 0, 319.5], [0, 156, 239.5], [0, 0, 1]], (8, 1, 1))
    dist = None if lens is None else np.tile(lens, (8, 1))
    return make_cameras(K, rig.R, rig.t, rig.size, dist, fisheye=lens is not None)


def test_poses_are_as_good_as_those_of_ordinary_lenses():
    scene = make_scene(8, fps=8 / 12, cameras=near_ring(FISHEYES["strong"]))
    with optimised():
        poses = reconstruct(scene, with_known_body(scene))
    assert poses.has_pose.all()
    assert scene.truth is not None
    away = 1e3 * np.linalg.norm(poses.joints - scene.truth.joints, axis=-1)
    # The bounds of `test_pipeline`.
    assert np.median(away) < 12
    assert away.max() < 50
