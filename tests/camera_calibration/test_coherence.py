"""Silhouette coherence: laws of the residual, of the rays and distances that it is made of, and of its slopes."""

import jax
import numpy as np
import pytest
from support.perturbed_rigs import (
    FOCAL,
    SIZE,
    VIEWS,
    filmed_with_lenses,
    looked_up,
    missed,
    moved,
    perturbed,
    residuals,
)
from support.phantoms import film, looking_at

from jaxskel import Recording, make_cameras, pack_silhouettes
from jaxskel.camera_calibration.from_silhouettes._coherence import sensitivity
from jaxskel.camera_calibration.from_silhouettes._distance_images import distance_images, onto_outlines
from jaxskel.cameras import ExtrinsicChange, changed
from jaxskel.outlines import outline

pytestmark = pytest.mark.slow

filmed = pytest.fixture(scope="module")(filmed_with_lenses)


def test_true_cameras_miss_by_less_than_a_pixel_and_wrong_ones_by_more(filmed):
    # Outlines are known to half a pixel, on either side of a contact; smoothing rounds where two limbs meet.
    true = missed(filmed, filmed.cameras)
    assert len(true) > 0.9 * 4 * VIEWS * 80
    assert np.quantile(true, 0.99) < 0.7
    assert true.max() < 2.0
    # Turned by half a degree, that is by 1.7 px.
    wrong = missed(filmed, perturbed(filmed.cameras, 0))
    assert np.maximum(wrong, 0).mean() > 5 * np.maximum(true, 0).mean()


def test_the_outline_of_a_turned_camera_misses_by_the_angle():
    # One ball at the height of the cameras around it. One camera is pitched by a degree: the rays over the top of the
    # ball, or under it, of this camera and of the others pass the other's ball by what it is raised.
    height, radius, pitch = 1.0, 0.3, np.radians(1.0)
    finer = 2.5  # a ball so large that a pixel is little
    around = 4.0 * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    R, t = zip(*(looking_at(np.array([*c, 1.0]), np.array([0.0, 0.0, height])) for c in around), strict=True)
    size = tuple(int(finer * n) for n in SIZE)
    K = np.array([[finer * FOCAL, 0, size[0] / 2 - 0.5], [0, finer * FOCAL, size[1] / 2 - 0.5], [0, 0, 1.0]])
    cameras = make_cameras(np.tile(K, (VIEWS, 1, 1)), R, t, size, np.zeros((VIEWS, 4)))
    drawn = film(cameras, [np.array([[0.0, 0.0, height, radius]])])
    ball = Recording(cameras, np.tile(drawn, (4, 1, 1, 1)), 25.0, "+Z", np.arange(4))
    up = np.zeros((VIEWS, 3))
    up[0, 0] = pitch
    with jax.enable_x64(True):
        rig = jax.tree.map(np.asarray, changed(cameras, ExtrinsicChange(up, np.zeros((VIEWS, 3)))))
    lines, images, contacts = looked_up(ball, rig)
    value = residuals(rig, lines, images, contacts)[0]
    most = np.array([value[lines.camera[0] == camera].max() for camera in range(VIEWS)])
    # 475 px times a degree: all are 4 m away.
    np.testing.assert_allclose(most[[0, 1, 3]], finer * FOCAL * pitch, atol=0.7)
    # The camera that faces the pitched one has a way out: x metres before the top its rays are lower, by 18 px/m in the
    # pitched view, but beside the ball, by 198 x^2 px, in the two others. 8.3 - 17.8 x = 198 x^2 leaves 5.3 px.
    assert most[2] == pytest.approx(5.3, abs=0.7)


def test_the_slopes_are_those_of_finite_differences(filmed):
    rig = perturbed(filmed.cameras, 1)
    lines, images, contacts = looked_up(filmed, rig)
    change = ExtrinsicChange(*(1e-6 * np.random.default_rng(2).normal(size=(2, VIEWS, 3))))
    back = jax.tree.map(np.negative, change)
    ahead, back = (residuals(rig, lines, images, contacts, by).ravel() for by in (change, back))
    with jax.enable_x64(True):
        found = sensitivity(rig, lines, images, contacts)
    unknowns = np.concatenate([change.rotation, change.shift], 1)
    expected = np.einsum("rci,ci->r", np.asarray(found.slopes), unknowns)
    # Between two values of a distance image the slope has a kink: a few rays lie there.
    off = np.abs((ahead - back) / 2 - expected)
    assert np.abs(expected).max() > 1e-4
    assert np.quantile(off, 0.98) < 1e-9


def test_what_is_frozen_does_not_change_the_slopes(filmed):
    # Contacts are looked up again after a small step: the residual changes as with those that were frozen.
    rig = perturbed(filmed.cameras, 1)
    lines, images, contacts = looked_up(filmed, rig)
    rng = np.random.default_rng(3)
    step = ExtrinsicChange(*(rng.normal(size=(2, VIEWS, 3)) * [[[2e-4]], [[1e-3]]]))
    with jax.enable_x64(True):
        other = jax.tree.map(np.asarray, changed(rig, step))
    start = residuals(rig, lines, images, contacts)
    frozen = residuals(rig, lines, images, contacts, step)
    free = residuals(other, lines, images, looked_up(filmed, other)[2])
    near = (start > -3) & (start < 20)
    assert np.median(np.abs(free - start)[near]) > 0.03
    assert np.quantile(np.abs(free - frozen)[near], 0.9) < 0.03


def test_moving_the_whole_rig_changes_no_residual(filmed):
    found = looked_up(filmed, filmed.cameras)
    one, two = (residuals(rig, *found) for rig in (filmed.cameras, moved(filmed.cameras, 5)))
    np.testing.assert_allclose(one, two, atol=1e-6)


@pytest.mark.parametrize("radius", [3.0, 5.0, 14.0])
def test_outlines_of_drawn_discs_are_neither_shrunk_nor_swollen(radius):
    # A finger is 3 px wide at times. The nearest pixels' centres alone leave 0.2 px of noise on each point.
    camera = make_cameras(np.eye(3)[None], np.eye(3)[None], np.zeros((1, 3)), (64, 64))
    v, u = np.mgrid[:64, :64]
    missed = []
    for middle in np.random.default_rng(0).uniform(29, 31, (40, 2)):
        drawn = pack_silhouettes(((u - middle[0]) ** 2 + (v - middle[1]) ** 2 <= radius**2)[None, None])
        images = distance_images(drawn, camera, np.zeros((1, 1), bool), 40)
        points = outline(drawn[0, 0], 64).astype(np.float32)
        found = onto_outlines(images, np.zeros(len(points), np.int32), points)
        missed.extend(np.linalg.norm(np.asarray(found) - middle, axis=1) - radius)
    assert abs(np.mean(missed)) < 0.05
    assert np.std(missed) < 0.25


def test_no_place_is_farther_from_a_person_than_the_edge_that_cuts_the_person_off():
    # Rows 10 to 19 of the right half: cut off by the right edge alone, behind which the person may be as near as it is.
    mask = np.zeros((1, 1, 40, 64), bool)
    mask[..., 10:20, 32:] = True
    camera = make_cameras(np.eye(3)[None], np.eye(3)[None], np.zeros((1, 3)), (64, 40))
    found = distance_images(pack_silhouettes(mask), camera, np.zeros((1, 1), bool), 40).values[0]
    np.testing.assert_allclose(found[35, [63, 60]], [0.5, 3.5])
    # Neither the lower edge nor the left one cuts: from there it is as far as to the silhouette, by steps of 3 x 3.
    np.testing.assert_allclose([found[39, 40], found[15, 0]], [19.5, 31.5], rtol=0.1)
