"""Cameras refined from silhouettes: laws of the residual, wrong rigs that come back, a real rig that gets better."""

from dataclasses import replace
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import chain, film, looking_at, ring
from scipy.spatial.transform import Rotation

from jaxskel import (
    Cameras,
    Recording,
    RefinedCameras,
    compare_rigs,
    make_cameras,
    pack_silhouettes,
    refine_cameras,
    unpack_silhouettes,
)
from jaxskel._camera_step import CameraStep
from jaxskel._coherence import NOTHING, coherence, sensitivity
from jaxskel._contacts import Contacts, find_contacts
from jaxskel._contours import outline
from jaxskel._distance_images import DistanceImages, distance_images, onto_outlines
from jaxskel._extrinsics import ExtrinsicChange, changed, no_change
from jaxskel._refine_cameras import _narrowed
from jaxskel._sight_lines import SightLines, sight_lines
from jaxskel._stacks import single_precision

SHARED = Path(__file__).parents[2] / "shared" / "data"
BALANCING = SHARED / "real" / "pose2sim_balancing"

# In one test this is all there is, so it is used in the others: nothing is compiled again.
USED = [0, 1, 2, *range(4, 13)]
# Few cameras, since work grows by the square of their number; the first and the third face each other, and so do the
# other two.
VIEWS, FRAMES = 4, 13
SIZE, FOCAL = (240, 200), 190.0
# A lens with all kinds of distortion, as wide as lenses are.
LENS = [-0.2, 0.06, 0.002, -0.003]


def body(seed: int) -> np.ndarray:
    """Trunk, head, and four limbs in random directions: balls (m)."""
    rng = np.random.default_rng(seed)
    middle = np.array([*rng.uniform(-0.4, 0.4, 2), 1.0])
    parts = [chain(middle - [0, 0, 0.25], middle + [0, 0, 0.3], 0.14, 6), np.array([[*(middle + [0, 0, 0.55]), 0.11]])]
    for height, side in ((0.25, 1), (0.25, -1), (-0.3, 1), (-0.3, -1)):
        start = middle + [0.0, 0.15 * side, height]
        way = rng.normal(size=3) + [0.0, 1.5 * side, 4 * height - 0.5]
        parts.append(chain(start, start + 0.65 * way / np.linalg.norm(way), 0.06, 9))
    return np.concatenate(parts)


def with_lens(cameras: Cameras) -> Cameras:
    return make_cameras(cameras.K, cameras.R, cameras.t, cameras.size, np.tile(LENS, (len(cameras), 1)))


def perturbed(cameras: Cameras, seed: int, turn: float = np.radians(0.5), shift: float = 0.010) -> Cameras:
    """Each camera turned about, and moved along, an axis of its own (rad, m)."""
    axes, ways = np.random.default_rng(seed).normal(size=(2, len(cameras), 3))
    axes, ways = (a / np.linalg.norm(a, axis=1, keepdims=True) for a in (axes, ways))
    R = Rotation.from_rotvec(turn * axes).as_matrix() @ np.asarray(cameras.R)
    t = -np.einsum("cij,cj->ci", R, cameras.centres + shift * ways)
    return make_cameras(cameras.K, R, t, cameras.size, cameras.dist)


def moved(cameras: Cameras, seed: int, scale: float = 1.0) -> Cameras:
    """The rig in a world that is turned, shifted and scaled."""
    rng = np.random.default_rng(seed)
    turn, shift = Rotation.random(random_state=seed).as_matrix(), rng.normal(size=3)
    R = np.asarray(cameras.R) @ turn.T
    t = -np.einsum("cij,cj->ci", R, scale * cameras.centres @ turn.T + shift)
    return make_cameras(cameras.K, R, t, cameras.size, cameras.dist)


@pytest.fixture(scope="module")
def filmed() -> Recording:
    """Thirteen frames in four views with distortion."""
    cameras = with_lens(ring(VIEWS, SIZE, FOCAL))
    return Recording(cameras, film(cameras, [body(seed) for seed in range(FRAMES)]), 25.0, "+Z", np.arange(FRAMES))


@pytest.fixture(scope="module")
def come_back(filmed) -> RefinedCameras:
    """Refined from a wrong rig."""
    return refine_cameras(replace(filmed, cameras=perturbed(filmed.cameras, 7)), USED)


def looked_up(recording: Recording, rig: Cameras) -> tuple[SightLines, DistanceImages, Contacts]:
    """Rays, distances and contacts of a rig on four frames; middles are those of `body`."""
    silhouettes = np.asarray(recording.silhouettes[:4])
    lost = ~silhouettes.any((2, 3))
    images = distance_images(silhouettes, rig, lost, 40)
    lines = sight_lines(silhouettes, rig, lost, images, 80)
    middles = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(silhouettes), 1))
    contacts = find_contacts(single_precision(rig), single_precision(lines), images, middles)
    double = jax.tree.map(lambda a: np.asarray(a, np.float64) if a.dtype.kind == "f" else np.asarray(a), contacts)
    return lines, images, double


def residuals(
    rig: Cameras, lines: SightLines, images: DistanceImages, contacts: Contacts, change: ExtrinsicChange | None = None
) -> np.ndarray:
    """By how much each ray of each frame misses (px), in double precision."""
    with jax.enable_x64(True):
        return np.asarray(coherence(change or no_change(rig), rig, lines, images, contacts))


def missed(recording: Recording, rig: Cameras) -> np.ndarray:
    """Residuals of the rays that tell anything (px)."""
    value = residuals(rig, *looked_up(recording, rig))
    return value[value > NOTHING]


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


def test_where_a_rig_ends_is_no_matter_of_where_it_began(filmed, come_back):
    refined = refine_cameras(filmed, USED)
    assert refined.converged
    apart = compare_rigs(refined.cameras, come_back.cameras)
    # What is left of the start is what silhouettes cannot tell, and the prior's.
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
    # The second camera shows the left half of its image only: where the person goes on beyond, nobody knows.
    size = np.array(filmed.cameras.size)
    size[1, 0] = SIZE[0] // 2
    cut = make_cameras(filmed.cameras.K, filmed.cameras.R, filmed.cameras.t, size, filmed.cameras.dist)
    masks = np.array(unpack_silhouettes(filmed.silhouettes, SIZE[0]))
    masks[:, 1, :, SIZE[0] // 2 :] = False
    value = missed(replace(filmed, cameras=cut, silhouettes=pack_silhouettes(masks)), cut)
    assert np.quantile(value, 0.99) < 0.7
    assert value.max() < 1.0


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
