"""Planes through two optical centres that touch two silhouettes: laws, and rigs that are wrong in known ways."""

import equinox as eqx
import jax
import numpy as np
import pytest
from support.phantoms import chain, film, ring

from jaxskel import Cameras, make_cameras, pack_silhouettes, unpack_silhouettes
from jaxskel.camera_calibration.from_silhouettes._coherence import Sensitivity
from jaxskel.camera_calibration.from_silhouettes._distance_images import distance_images
from jaxskel.camera_calibration.from_silhouettes._epipolar_tangents import (
    EpipolarTangents,
    epipolar_tangents,
    tangent_sensitivity,
)
from jaxskel.camera_calibration.from_silhouettes._outline_chains import outline_chains
from jaxskel.cameras import ExtrinsicChange, changed

pytestmark = pytest.mark.slow

# The first camera faces the fourth, and so on.
VIEWS, FRAMES = 6, 5
SIZE, FOCAL = (240, 200), 190.0
MIDDLES = np.tile([0.0, 0.0, 1.0], (FRAMES, 1))


@pytest.fixture(scope="module")
def cameras() -> Cameras:
    return ring(VIEWS, SIZE, FOCAL)


@pytest.fixture(scope="module")
def silhouettes(cameras) -> np.ndarray:
    """A person with two limbs in random directions."""
    rng = np.random.default_rng(0)
    ends = np.array([0.0, 0.0, 1.0]) + rng.uniform(-0.5, 0.5, (FRAMES, 3, 3))
    return film(cameras, [np.concatenate([chain(a, b, 0.1, 12), chain(b, c, 0.07, 12)]) for a, b, c in ends])


def tangents(rig: Cameras, silhouettes: np.ndarray, gate: float = 0.0) -> EpipolarTangents:
    """Without a gate, the outermost ones alone."""
    empty_views = ~silhouettes.any((2, 3))
    images = distance_images(silhouettes, rig, empty_views, 40)
    return epipolar_tangents(rig, outline_chains(silhouettes, rig, empty_views, images), MIDDLES, gate)


def apart(rig: Cameras, found: EpipolarTangents) -> Sensitivity:
    with jax.enable_x64(True):
        return jax.tree.map(np.asarray, tangent_sensitivity(rig, found))


def turned(rig: Cameras, unknowns: np.ndarray) -> Cameras:
    with jax.enable_x64(True):
        return jax.tree.map(np.asarray, changed(rig, ExtrinsicChange(unknowns[:, :3], unknowns[:, 3:])))


def test_planes_of_a_true_rig_are_one_but_for_the_pixels(cameras, silhouettes):
    found = tangents(cameras, silhouettes)
    value = apart(cameras, found).value
    assert np.abs(value[found.there]).max() < 1.0
    assert np.sqrt((value[found.there] ** 2).mean()) < 0.3


def test_two_outermost_planes_a_pair_but_for_cameras_that_face_each_other(cameras):
    # Of two cameras that face each other one is high, the other low: half-way between them is a ball.
    ball = np.array([0.0, 0.0, cameras.centres[[0, 3], 2].mean()])
    found = tangents(cameras, film(cameras, FRAMES * [np.array([[*ball, 0.3]])]))
    facing = found.cameras[:, 1] - found.cameras[:, 0] == VIEWS // 2
    pairs = VIEWS * (VIEWS - 1) // 2
    assert found.there.sum() == 2 * FRAMES * (pairs - VIEWS // 2)
    assert not found.there[facing].any()
    assert (apart(cameras, found).value[~found.there] == 0).all()
    # Half of the planes touch it above, half below.
    rays = np.einsum("pkji,pkj->pki", np.asarray(cameras.R)[found.cameras], found.directions)[found.there]
    middle = (ball - cameras.centres)[found.cameras][found.there]
    above = rays[..., 2] > middle[..., 2] / np.linalg.norm(middle, axis=-1)
    assert (above[:, 0] == above[:, 1]).all()
    assert above[:, 0].mean() == 0.5


def test_planes_that_are_nearly_one_are_taken_for_one(cameras):
    # Six limbs in random directions, so that there are tips between the outermost ones.
    middle, rng = MIDDLES[0], np.random.default_rng(3)
    tips = rng.normal(size=(FRAMES, 6, 3))
    tips = middle + 0.6 * tips / np.linalg.norm(tips, axis=-1, keepdims=True)
    silhouettes = film(cameras, [np.concatenate([chain(middle, tip, 0.07, 12) for tip in star]) for star in tips])
    outermost, found = tangents(cameras, silhouettes), tangents(cameras, silhouettes, 0.75)
    assert found.there.sum() > 1.3 * outermost.there.sum()
    # Cameras that face each other have some, too.
    assert found.there[found.cameras[:, 1] - found.cameras[:, 0] == VIEWS // 2].any()
    value = apart(cameras, found).value[found.there]
    assert np.sqrt((value**2).mean()) < 0.3
    assert np.abs(np.median(value)) < 0.05
    # A gate as wide as an image leaves no plane alone.
    wide = tangents(cameras, silhouettes, 200.0)
    assert wide.there.sum() == outermost.there.sum()


def test_planes_err_together_that_touch_one_tip(cameras):
    # Of a thin limb that stands upright all planes touch one of the two ends, but those of facing cameras, in which all
    # of it lies: they touch it anywhere.
    thin = chain(np.array([0.0, 0.0, 0.6]), np.array([0.0, 0.0, 1.4]), 0.02, 40)
    found = tangents(cameras, film(cameras, FRAMES * [thin]))
    assert found.there.sum() == FRAMES * VIEWS * (VIEWS - 1)
    assert np.abs(found.alike[found.there] - (VIEWS - 1)).max() <= 1
    # Of a ball each plane touches another place.
    ball = np.array([[*MIDDLES[0], 0.5]])
    assert tangents(cameras, film(cameras, FRAMES * [ball])).alike.max() < VIEWS - 2


def test_planes_count_in_what_their_rays_err(cameras, silhouettes):
    found = tangents(cameras, silhouettes)
    poor = eqx.tree_at(lambda f: f.error, found, 3 * found.error)
    for a, b in zip(*(jax.tree.leaves(apart(cameras, f)) for f in (poor, found)), strict=True):
        np.testing.assert_allclose(3 * a, b, rtol=1e-9)


def test_a_tip_that_pixels_do_not_resolve_errs_more(cameras):
    # Limbs from the middle to both sides; one ends in a fist, the other in fingers with gaps between them.
    fist = [chain([0.0, 0.0, 1.0], [0.4, 0.4, 1.4], 0.12, 12)]
    ends = np.array([-0.4, -0.4, 0.6]) + 0.045 * np.arange(-1, 2)[:, None] * [1.0, -1.0, 0.0]
    hand = [chain([0.0, 0.0, 1.0], end, 0.02, 40) for end in ends]
    found = tangents(cameras, film(cameras, FRAMES * [np.concatenate(fist + hand)]))
    rays = np.einsum("pkji,pkj->pki", np.asarray(cameras.R)[found.cameras], found.directions)
    above = cameras.centres[found.cameras] + 4.0 * rays
    up, down = (found.error[found.there & side] for side in ((above[..., 2] > 1).all(1), (above[..., 2] < 1).all(1)))
    assert min(len(up), len(down)) >= 10 * FRAMES
    assert np.median(down) > 1.3 * np.median(up)


def test_outlines_are_followed_with_the_person_on_one_side(cameras):
    # A ring: its outer outline turns around the person, its hole around nothing.
    v, u = np.mgrid[: SIZE[1], : SIZE[0]]
    away = np.hypot(u - 120.3, v - 99.6)
    drawn = pack_silhouettes(np.tile((away > 20) & (away < 40), (1, VIEWS, 1, 1)))
    empty_views = np.zeros((1, VIEWS), bool)
    found = outline_chains(drawn, cameras, empty_views, distance_images(drawn, cameras, empty_views, 40))
    assert (found.count == found.count[0, 0]).all()
    own = slice(0, found.count[0, 0])
    K = np.asarray(cameras.K[0])
    uv = found.directions[own, :2] / found.directions[own, 2:] * [K[0, 0], K[1, 1]] + K[:2, 2]
    radius = np.hypot(uv[:, 0] - 120.3, uv[:, 1] - 99.6)
    np.testing.assert_allclose(radius, np.where(radius > 30, 40, 20), atol=0.6)
    np.testing.assert_array_equal(found.convex[own], radius > 30)
    # Neighbours are near, six on either side, also where an outline closes.
    steps = np.linalg.norm(uv[found.neighbours[own]] - uv[:, None], axis=-1)
    assert steps.max() < 6 * 1.8
    assert steps[:, [0, -1]].min() > 3


def test_a_pitch_tells_in_both_directions_by_its_pixels(cameras, silhouettes):
    # Neighbours are seen from aside: up and down in the image is across the planes.
    unknowns, signs = np.zeros((VIEWS, 6)), []
    for pitch in np.radians([1.0, -1.0]):
        unknowns[0, 0] = pitch
        wrong = turned(cameras, unknowns)
        found = tangents(wrong, silhouettes)
        value = apart(wrong, found).value
        neighbour = found.there & (found.cameras == [0, 1]).all(1)
        # One of two rays errs, by the pitch in pixels, less where a plane is slanted.
        missed = np.abs(value[neighbour]) / (FOCAL * abs(pitch))
        signs.append(np.sign(value[neighbour]))
        assert np.sqrt(0.5) * np.cos(np.radians(55)) < missed.min()
        assert missed.max() < np.sqrt(0.5) + 0.05
        others = found.there & (found.cameras != 0).all(1)
        assert np.abs(value[others]).max() < 1.0
    assert len(signs[0]) == 2 * FRAMES
    assert (signs[0] == signs[0][0]).all()
    assert (signs[1] == -signs[0][0]).all()


def test_the_slopes_are_those_of_finite_differences(cameras, silhouettes):
    found = tangents(cameras, silhouettes)
    way = 1e-6 * np.random.default_rng(1).normal(size=(VIEWS, 6))
    slopes = np.einsum("pci,ci->p", apart(cameras, found).slopes, way)
    expected = (apart(turned(cameras, way), found).value - apart(turned(cameras, -way), found).value) / 2
    np.testing.assert_allclose(slopes, expected, atol=1e-9)
    assert np.abs(slopes).max() > 1e-5


def test_specks_do_not_count_and_views_that_cut_the_person_off_tell_nothing(cameras, silhouettes):
    masks = np.array(unpack_silhouettes(silhouettes, SIZE[0]))
    masks[:, 2, 5:9, 5:9] = True
    specks = tangents(cameras, pack_silhouettes(masks))
    before = tangents(cameras, silhouettes)
    assert np.array_equal(specks.there, before.there)
    assert np.abs(apart(cameras, specks).value).max() < 1.0
    rows = np.flatnonzero(masks[0, 1].any(1))
    masks[0, 1, rows[len(rows) // 2] :, SIZE[0] // 2] = True  # as if legs went on below the image
    cut = tangents(cameras, pack_silhouettes(masks))
    # All that is gone are the planes of the second view in the first frame.
    seen, of_second = ((found.cameras[found.there] == 1).any(1) for found in (cut, specks))
    assert (~seen).sum() == (~of_second).sum()
    assert of_second.sum() - seen.sum() == 2 * (VIEWS - 1)
    first = cut.there[: len(cut.there) // FRAMES]
    assert not (cut.cameras[: len(first)][first] == 1).any()


def test_optical_centres_that_are_one_give_no_plane_and_no_nan(cameras, silhouettes):
    R, t = np.array(cameras.R), np.array(cameras.t)
    R[1], t[1] = R[0], t[0]
    same = make_cameras(cameras.K, R, t, cameras.size)
    found = tangents(same, silhouettes)
    assert not found.there[(found.cameras == [0, 1]).all(1)].any()
    value = apart(same, found)
    assert np.isfinite(value.value).all()
    assert np.isfinite(value.slopes).all()
