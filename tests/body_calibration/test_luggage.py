"""Luggage: found where something goes with the chest, and only there."""

import numpy as np
import pytest
from support.capsule_films import ADULT, BODY, film_body, some

from jaxskel._runtime.batching import on_device
from jaxskel.body import BALL_NAMES, Body, measured_body, people_prior
from jaxskel.body_calibration import Luggage, carrying, find_luggage, prior_with_luggage, usual_backpack
from jaxskel.synthetic import demo_motion

pytestmark = pytest.mark.slow

# Of the demo motion at 5 frames a second: two of a walk, waving, a turn, crane stand, crouch, twice hands on hips.
FRAMES = [7, 9, 18, 35, 43, 50, 55, 57]
TRUTH = some(demo_motion(ADULT), FRAMES)
BAG = [BALL_NAMES.index(f"{side}_bag_{end}") for side in "lr" for end in ("top", "low")]


def loaded(front: float, radius: float = 0.11) -> Body:
    """The body with a bag in front of the chest, or behind it (m)."""
    offsets, radii = np.array(BODY.offsets), np.array(BODY.radii)
    offsets[BAG] = [[front, side * 0.06, up] for side in (1, -1) for up in (0.34, 0.2)]
    radii[BAG] = radius
    return Body(ADULT, BODY.segments, offsets, radii, BODY.links)


def found(body: Body) -> Luggage | None:
    """What is found if the body without a bag is in the true poses."""
    return find_luggage(BODY, TRUTH, on_device(film_body(TRUTH, 5.0, body).observed), np.arange(len(FRAMES)))


@pytest.mark.parametrize("front", [-0.2, 0.24])
def test_a_bag_is_where_it_is(front):
    luggage = found(loaded(front))
    assert luggage is not None
    true = loaded(front)
    np.testing.assert_allclose(luggage.ends, np.asarray(true.offsets)[BAG[:2]], atol=0.08)
    assert luggage.radius == pytest.approx(0.11, abs=0.04)


def test_a_body_without_a_bag_carries_nothing():
    assert found(BODY) is None


def test_a_bag_that_hides_in_the_chest_is_none():
    assert found(loaded(0.0, 0.03)) is None


def test_a_shape_with_luggage_has_it_on_both_sides():
    luggage = Luggage(np.array([[-0.2, 0.06, 0.3], [-0.25, 0.05, 0.1]]), 0.12)
    mean = people_prior(ADULT, ADULT.stature).mean
    before = measured_body(ADULT, mean)
    shape = carrying(mean, before, luggage)
    body = measured_body(ADULT, shape)
    np.testing.assert_allclose(body.offsets[BAG[:2]], luggage.ends, atol=1e-6)
    np.testing.assert_allclose(body.offsets[BAG[2:]], luggage.ends * [1, -1, 1], atol=1e-6)
    np.testing.assert_allclose(body.radii[BAG], 0.12, atol=1e-6)
    others = np.setdiff1d(np.arange(len(BALL_NAMES)), BAG)
    np.testing.assert_array_equal(body.offsets[others], before.offsets[others])


def test_the_usual_backpack_is_on_the_back_and_as_large_as_the_person():
    usual, half = usual_backpack(ADULT), usual_backpack(ADULT.scaled(0.5))
    assert (usual.ends[:, 0] < 0).all()
    assert usual.ends[0, 2] > usual.ends[1, 2]
    np.testing.assert_allclose(half.ends, usual.ends / 2)
    assert half.radius == pytest.approx(usual.radius / 2)


def test_a_prior_with_luggage_differs_in_nothing_else():
    prior = people_prior(ADULT, ADULT.stature)
    shape = carrying(prior.mean, measured_body(ADULT, prior.mean), Luggage(np.full((2, 3), 0.1), 0.1))
    other = prior_with_luggage(prior, shape)
    differs = np.flatnonzero(other.mean.vector != prior.mean.vector)
    np.testing.assert_allclose(np.diagonal(other.precision)[differs], 0.03**-2)
    np.testing.assert_array_equal(other.mean.vector[differs], shape.vector[differs])
    same = other.precision == prior.precision
    same[differs, differs] = True
    assert same.all()
    assert len(differs) <= 8
