"""Planes through two optical centres that touch two silhouettes: laws, and rigs that are wrong in known ways."""

import jax
import numpy as np
import pytest
from drawn import chain, film, ring

from jaxskel import Cameras, make_cameras, pack_silhouettes, unpack_silhouettes
from jaxskel._coherence import Sensitivity
from jaxskel._distance_images import distance_images
from jaxskel._epipolar_tangents import EpipolarTangents, convex_outlines, epipolar_tangents, tangent_sensitivity
from jaxskel._extrinsics import ExtrinsicChange, changed

# The first camera faces the fourth, and so on.
VIEWS, FRAMES = 6, 5
SIZE, FOCAL = (240, 200), 190.0
MIDDLES = np.tile([0.0, 0.0, 1.0], (FRAMES, 1))


@pytest.fixture(scope="module")
def cameras() -> Cameras:
    return ring(VIEWS, SIZE, FOCAL)


@pytest.fixture(scope="module")
def silhouettes(cameras) -> np.ndarray:
    """Of two limbs in random directions."""
    rng = np.random.default_rng(0)
    ends = np.array([0.0, 0.0, 1.0]) + rng.uniform(-0.5, 0.5, (FRAMES, 3, 3))
    return film(cameras, [np.concatenate([chain(a, b, 0.1, 12), chain(b, c, 0.07, 12)]) for a, b, c in ends])


def tangents(rig: Cameras, silhouettes: np.ndarray) -> EpipolarTangents:
    lost = ~silhouettes.any((2, 3))
    images = distance_images(silhouettes, rig, lost, 40)
    return epipolar_tangents(rig, convex_outlines(silhouettes, rig, lost, images), MIDDLES)


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
    np.testing.assert_array_equal(found.there, ~facing)
    assert (apart(cameras, found).value[facing] == 0).all()
    # Half of the planes touch it above, half below.
    rays = np.einsum("pkji,pkj->pki", np.asarray(cameras.R)[found.cameras], found.directions)[~facing]
    middle = (ball - cameras.centres)[found.cameras][~facing]
    above = rays[..., 2] > middle[..., 2] / np.linalg.norm(middle, axis=-1)
    assert (above[:, 0] == above[:, 1]).all()
    assert above[:, 0].mean() == 0.5


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
    assert np.array_equal(specks.there, tangents(cameras, silhouettes).there)
    assert np.abs(apart(cameras, specks).value).max() < 1.0
    rows = np.flatnonzero(masks[0, 1].any(1))
    masks[0, 1, rows[len(rows) // 2] :, SIZE[0] // 2] = True  # as if legs went on below the image
    cut = tangents(cameras, pack_silhouettes(masks))
    gone = specks.there & ~cut.there
    assert (cut.cameras[gone] == 1).any(1).all()
    assert gone.sum() == 2 * (VIEWS - 1)


def test_optical_centres_that_are_one_give_no_plane_and_no_nan(cameras, silhouettes):
    R, t = np.array(cameras.R), np.array(cameras.t)
    R[1], t[1] = R[0], t[0]
    same = make_cameras(cameras.K, R, t, cameras.size)
    found = tangents(same, silhouettes)
    assert not found.there[(found.cameras == [0, 1]).all(1)].any()
    value = apart(same, found)
    assert np.isfinite(value.value).all()
    assert np.isfinite(value.slopes).all()
