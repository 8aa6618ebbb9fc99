"""Additions: bags and hair get a place of their own, and nothing else of a body changes."""

import numpy as np
import pytest
from support.capsule_films import ADULT

from jaxskel.body import BALL_NAMES, default_adult, make_body, measured_body, people_prior
from jaxskel.body_calibration import Addition, prior_with_addition, usual_backpack, usual_hair, with_addition

BAG = [BALL_NAMES.index(f"{side}_bag_{end}") for side in "lr" for end in ("top", "low")]
HAIR = [BALL_NAMES.index(f"hair_{end}") for end in ("top", "low")]
PRIOR = people_prior(ADULT, ADULT.stature)
BEFORE = measured_body(ADULT, PRIOR.mean)
ADDITIONS = {"bag": (usual_backpack(ADULT), BAG), "hair": (usual_hair(ADULT), HAIR)}


@pytest.mark.parametrize("name", ADDITIONS)
def test_a_shape_with_an_addition_differs_in_nothing_else(name):
    addition, balls = ADDITIONS[name]
    body = measured_body(ADULT, with_addition(PRIOR.mean, BEFORE, addition))
    np.testing.assert_allclose(body.offsets[balls[:2]], addition.ends, atol=1e-6)
    np.testing.assert_allclose(body.radii[balls], addition.radius, atol=1e-6)
    others = np.setdiff1d(np.arange(len(BALL_NAMES)), balls)
    np.testing.assert_array_equal(body.offsets[others], BEFORE.offsets[others])
    np.testing.assert_array_equal(body.radii[others], BEFORE.radii[others])


def test_a_bag_is_on_both_sides():
    body = measured_body(ADULT, with_addition(PRIOR.mean, BEFORE, usual_backpack(ADULT)))
    np.testing.assert_allclose(body.offsets[BAG[2:]], body.offsets[BAG[:2]] * [1, -1, 1], atol=1e-6)
    top, low = usual_backpack(ADULT).ends
    assert top[2] > low[2]


@pytest.mark.parametrize("usual", [usual_backpack, usual_hair])
def test_what_is_usual_is_behind_and_as_large_as_the_person(usual):
    whole, half = usual(ADULT), usual(ADULT.scaled(0.5))
    assert (whole.ends[:, 0] < 0).all()
    np.testing.assert_allclose(half.ends, whole.ends / 2)
    assert half.radius == pytest.approx(whole.radius / 2)


@pytest.mark.parametrize("stature", [1.2, 1.7, 1.9])
def test_bag_and_hair_are_hidden_in_whoever_has_none(stature):
    body = make_body(default_adult(stature))
    bones = dict(zip(BALL_NAMES, zip(np.asarray(body.offsets), np.asarray(body.radii), strict=True), strict=True))
    for ball, around in (("hair_low", "nape"), ("l_bag_top", "l_chest"), ("l_bag_low", "l_chest")):
        (centre, radius), (middle, size) = bones[ball], bones[around]
        assert np.linalg.norm(centre - middle) + radius < size
    # The hair's upper ball lies on the axis between two balls of the head.
    (centre, radius), (face, _), (crown, _) = (bones[ball] for ball in ("hair_top", "face", "crown"))
    share = (centre - face) @ (crown - face) / ((crown - face) @ (crown - face))
    away = np.linalg.norm(centre - face - np.clip(share, 0, 1) * (crown - face))
    assert away + radius < min(bones["face"][1], bones["crown"][1])


@pytest.mark.parametrize("name", ADDITIONS)
def test_a_prior_with_an_addition_differs_in_nothing_else(name):
    addition = ADDITIONS[name][0]
    shape = with_addition(PRIOR.mean, BEFORE, addition)
    other = prior_with_addition(PRIOR, shape, addition)
    differs = np.flatnonzero(np.diagonal(other.precision) != np.diagonal(PRIOR.precision))
    assert len(differs) == 8
    np.testing.assert_allclose(np.diagonal(other.precision)[differs], 0.03**-2)
    np.testing.assert_array_equal(other.mean.vector[differs], shape.vector[differs])
    same, others = other.precision == PRIOR.precision, np.setdiff1d(np.arange(len(other.mean.vector)), differs)
    same[differs, differs] = True
    assert same.all()
    np.testing.assert_array_equal(other.mean.vector[others], PRIOR.mean.vector[others])


def test_bag_and_hair_may_be_had_together():
    shape = with_addition(PRIOR.mean, BEFORE, usual_backpack(ADULT))
    both = with_addition(shape, measured_body(ADULT, shape), usual_hair(ADULT))
    body = measured_body(ADULT, both)
    for addition, balls in ADDITIONS.values():
        np.testing.assert_allclose(body.offsets[balls[:2]], addition.ends, atol=1e-6)


def test_hair_is_told_from_bags():
    assert usual_hair(ADULT).is_hair
    assert not usual_backpack(ADULT).is_hair
    assert isinstance(usual_hair(ADULT), Addition)
