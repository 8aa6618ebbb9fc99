"""Cameras refined from silhouettes: wrong rigs that come back, a real rig that gets better."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.perturbed_rigs import SIZE, VIEWS, filmed_with_lenses, missed, moved, perturbed
from support.phantoms import ring
from support.shared_data import SHARED

from jaxskel import Recording, make_cameras, pack_silhouettes, refine_cameras, unpack_silhouettes
from jaxskel.camera_calibration.from_silhouettes import RefinedCameras
from jaxskel.camera_calibration.from_silhouettes._refine_cameras import _narrowed
from jaxskel.camera_calibration.from_silhouettes._step import CameraStep
from jaxskel.cameras import ExtrinsicChange, changed, compare_rigs
from jaxskel.synthetic import make_scene

pytestmark = pytest.mark.slow

BALANCING = SHARED / "real" / "pose2sim_balancing"

# One test has only this many frames; the others use the same number, so that nothing is compiled again.
USED = [0, 1, 2, *range(4, 13)]


filmed = pytest.fixture(scope="module")(filmed_with_lenses)


@pytest.fixture(scope="module")
def come_back(filmed) -> RefinedCameras:
    """Refined from a wrong rig."""
    return refine_cameras(replace(filmed, cameras=perturbed(filmed.cameras, 7)), USED)


def test_rigs_are_compared_up_to_a_similarity():
    cameras = ring(VIEWS)
    apart = compare_rigs(moved(cameras, 3, scale=1.1), cameras)
    np.testing.assert_allclose(apart.angles, 0.0, atol=1e-7)
    np.testing.assert_allclose(apart.distances, 0.0, atol=1e-9)
    assert apart.scale == pytest.approx(1 / 1.1)
    # Two cameras that turn by opposite angles: their mean stays.
    turned = np.zeros((VIEWS, 3))
    turned[0, 2], turned[1, 2] = 0.01, -0.01
    with jax.enable_x64(True):
        other = changed(cameras, ExtrinsicChange(turned, np.zeros((VIEWS, 3))))
        other = eqx.tree_at(lambda c: (c.R, c.t), cameras, (np.asarray(other.R), np.asarray(other.t)))
    angles = compare_rigs(moved(other, 4), cameras).angles
    assert angles[:2].min() > 0.007
    assert angles[2:].max() < 0.004
    with pytest.raises(ValueError, match="cannot be compared"):
        compare_rigs(cameras, cameras[:3])


def test_a_perturbed_rig_comes_back(filmed, come_back):
    wrong, refined = perturbed(filmed.cameras, 7), come_back
    assert np.degrees(compare_rigs(wrong, filmed.cameras).angles).max() > 0.4
    # Images are 240 px wide: a pixel is 0.3 degrees.
    angles = np.degrees(compare_rigs(refined.cameras, filmed.cameras).angles)
    assert angles.max() < 0.2
    assert angles.mean() < 0.12
    assert refined.converged
    assert not refined.hardly_seen.any()
    assert (refined.after < 0.5 * refined.before).all()
    np.testing.assert_array_equal(refined.frames, USED)
    np.testing.assert_array_equal(refined.cameras.K, wrong.K)
    np.testing.assert_array_equal(refined.cameras.dist, wrong.dist)
    assert refined.cameras.names == wrong.names
    # The change is what it says.
    turned = np.asarray(refined.cameras.R) @ np.asarray(wrong.R).swapaxes(-1, -2)
    np.testing.assert_allclose(Rotation.from_matrix(turned).as_rotvec(), refined.rotation, atol=1e-9)
    np.testing.assert_allclose(refined.cameras.centres - wrong.centres, refined.shift, atol=1e-9)


def test_the_rig_of_a_film_of_usual_size_comes_back_within_a_tenth_of_a_degree():
    # The package's own scene: eight views of 640 x 480 pixels, every fifth of its sixty frames.
    scene = make_scene(12, 1.0)
    wrong = perturbed(scene.cameras, 7)
    refined = refine_cameras(replace(scene, cameras=wrong))
    apart = compare_rigs(refined.cameras, scene.cameras)
    assert refined.converged
    assert len(refined.frames) == 12
    assert np.degrees(apart.angles).max() < 0.1
    assert apart.distances.max() < 0.01
    assert np.degrees(compare_rigs(wrong, scene.cameras).angles).min() > 0.2


def test_where_a_rig_ends_is_no_matter_of_where_it_began(filmed, come_back):
    refined = refine_cameras(filmed, USED)
    assert refined.converged
    apart = compare_rigs(refined.cameras, come_back.cameras)
    # The start affects only what silhouettes cannot determine, and the prior.
    assert np.degrees(apart.angles).max() < 0.1
    apart = compare_rigs(refined.cameras, filmed.cameras)
    # A true rig stays but for what the pixels of small images leave open: half a pixel is 0.15 degrees.
    assert np.degrees(apart.angles).max() < 0.15
    assert apart.distances.max() < 0.015


def test_the_prior_is_narrowed_to_what_changes_could_be_drawn_from():
    given, cams = np.repeat([0.02, 0.03], 3), 4000
    drawn = np.random.default_rng(0).normal(size=(cams, 6)) * np.repeat([0.5, 0.2], 3)
    # Known exactly, known not at all, and both.
    for unknowns, spread, expected in (
        (drawn, 0.0, [0.5, 0.2]),
        (0 * drawn, 1.0, [1.0, 1.0]),
        (drawn, 0.5, [np.sqrt(0.5), np.sqrt(0.29)]),
        (0.1 * drawn, 0.0, [0.1, 0.1]),  # no narrower than that
        (4 * drawn, 0.0, [1.0, 0.8]),  # no wider than as given
    ):
        step = CameraStep(jnp.asarray(unknowns), jnp.full((cams, 6), spread))
        np.testing.assert_allclose(_narrowed(step, given, given), given * np.repeat(expected, 3), rtol=0.03)


def test_a_narrow_prior_keeps_the_cameras_where_they_are(filmed):
    wrong = perturbed(filmed.cameras, 7)
    refined = refine_cameras(replace(filmed, cameras=wrong), USED, rotation_sd=1e-6, shift_sd=1e-6)
    assert np.abs(refined.rotation).max() < 1e-5
    assert np.abs(refined.shift).max() < 1e-5


def test_a_camera_that_sees_nobody_stays_and_is_named(filmed):
    masks = np.array(filmed.silhouettes)
    masks[:, 2] = 0
    masks[3] = 0
    wrong = perturbed(filmed.cameras, 7)
    refined = refine_cameras(eqx.tree_at(lambda r: (r.cameras, r.silhouettes), filmed, (wrong, masks)))
    np.testing.assert_array_equal(refined.frames, USED)
    np.testing.assert_array_equal(refined.hardly_seen, np.arange(VIEWS) == 2)
    np.testing.assert_allclose(refined.rotation[2], 0.0, atol=1e-9)
    assert np.isnan(refined.before[2])
    others = [0, 1, 3]
    assert np.degrees(compare_rigs(refined.cameras[others], filmed.cameras[others]).angles).mean() < 0.15


def test_without_three_views_nothing_changes(filmed):
    masks = np.array(filmed.silhouettes)
    masks[:, 2:] = 0
    for frames in (5, [2, 3]):
        refined = refine_cameras(eqx.tree_at(lambda r: r.silhouettes, filmed, masks), frames)
        assert not refined.converged
        assert refined.hardly_seen.all()
        assert len(refined.frames) == 0
        assert np.isnan(refined.before).all()
        np.testing.assert_array_equal(refined.cameras.R, filmed.cameras.R)
        np.testing.assert_array_equal(refined.cameras.t, filmed.cameras.t)


def test_wrong_input_is_named(filmed):
    for arguments, message in (
        ({"frames": [3, 13]}, "there is no frame 13; give 0 to 12"),
        ({"frames": 0}, "frames 0: give one or more"),
        ({"rotation_sd": 0.0}, "rotation_sd 0.0"),
        ({"shift_sd": float("nan")}, "shift_sd nan"),
    ):
        with pytest.raises(ValueError, match=message):
            refine_cameras(filmed, **arguments)


def test_a_person_cut_off_by_the_image_is_no_evidence(filmed):
    # The second camera shows only the left half of its image, so the rest of the person is unknown.
    size = np.array(filmed.cameras.size)
    size[1, 0] = SIZE[0] // 2
    cut = make_cameras(filmed.cameras.K, filmed.cameras.R, filmed.cameras.t, size, filmed.cameras.dist)
    masks = np.array(unpack_silhouettes(filmed.silhouettes, SIZE[0]))
    masks[:, 1, :, SIZE[0] // 2 :] = False
    value = missed(replace(filmed, cameras=cut, silhouettes=pack_silhouettes(masks)), cut)
    assert np.quantile(value, 0.99) < 0.7
    assert value.max() < 1.0


@pytest.mark.skipif(not BALANCING.exists(), reason="needs pose2sim_balancing in ../shared/data/real")
def test_a_real_rig_agrees_better_in_frames_that_were_not_used():
    calibration, masks = np.load(BALANCING / "calibration.npz"), np.load(BALANCING / "masks_balance.npz")
    names = [f"cam0{i}" for i in range(1, 5)]
    sizes = np.array([masks[f"{name}_shape"][[2, 1]] for name in names])
    silhouettes = np.zeros((100, 4, sizes[:, 1].max(), -(-sizes[:, 0].max() // 8)), np.uint8)
    for view, name in enumerate(names):
        packed = masks[name]
        silhouettes[:, view, : packed.shape[1], : packed.shape[2]] = packed
    cameras = make_cameras(calibration["K"], calibration["R"], calibration["t"], sizes, names=names)
    recording = Recording(cameras, silhouettes, 60.0, "+Z", np.arange(100))
    used, others = np.arange(0, 100, 10), np.arange(5, 100, 10)
    refined = refine_cameras(recording, used)
    assert refined.converged
    after = refine_cameras(replace(recording, cameras=refined.cameras), others, 1e-6, 1e-6).before
    before = refine_cameras(recording, others, 1e-6, 1e-6).before
    assert (after < 0.5 * before).all()
