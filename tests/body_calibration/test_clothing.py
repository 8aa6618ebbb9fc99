"""What clothes add to a body: a variance of its own for each part, which the body decides."""

import numpy as np
import pytest
from support.people import ADULT

from jaxskel.body import BALL_NAMES, FREE_BALLS, QUANTITIES, Prior, Shape, measured_body, people_prior
from jaxskel.body_calibration import dressed
from jaxskel.body_calibration._clothing import Clothing

PRIOR = people_prior(ADULT, ADULT.stature)
FREE = [BALL_NAMES[ball].removeprefix("l_") for ball in FREE_BALLS]
CHEST = QUANTITIES.index("chest radius")


def settled(vector: np.ndarray) -> Clothing:
    """Deviations after many updates for one body."""
    clothing = Clothing()
    for _ in range(40):
        clothing = clothing.given(PRIOR, vector)
    return clothing


def allowed(clothing: Clothing, quantity: int) -> float:
    """How much variance of a quantity clothes add."""
    wider = np.linalg.inv(clothing.precision(PRIOR) + 1e-6 * np.eye(len(QUANTITIES)))
    return (
        wider[quantity, quantity] - np.linalg.inv(PRIOR.precision + 1e-6 * np.eye(len(QUANTITIES)))[quantity, quantity]
    )


def test_the_precision_is_the_inverse_of_the_sum_of_both_covariances():
    regular = Prior(PRIOR.mean, PRIOR.precision + np.eye(len(QUANTITIES)))
    added = np.linalg.inv(Clothing().precision(regular)) - np.linalg.inv(regular.precision)
    worn = np.diagonal(added) > 1e-5
    expected = np.zeros(len(QUANTITIES))
    expected[worn] = Clothing().deviations ** 2
    np.testing.assert_allclose(added, np.diag(expected), atol=1e-7)
    names = {quantity.split()[0] for quantity, wears in zip(QUANTITIES, worn, strict=True) if wears}
    assert "chest" in names
    assert not names & {"palm", "finger", "toe", "trunk", "thigh", "shank"}


def test_a_naked_body_wears_nothing():
    np.testing.assert_allclose(settled(PRIOR.mean.vector).deviations, 0.0, atol=2e-3)


def test_a_part_that_looked_thin_at_first_may_still_wear_something():
    vector = PRIOR.mean.vector.copy()
    vector[CHEST] -= 0.01
    clothing = Clothing().given(PRIOR, vector)
    vector[CHEST] += 0.07
    for _ in range(20):
        clothing = clothing.given(PRIOR, vector)
    assert allowed(clothing, CHEST) > 0.04**2


def test_a_thick_part_wears_something_and_the_others_do_not():
    vector = PRIOR.mean.vector.copy()
    vector[CHEST] += 0.06
    clothing = settled(vector)
    assert clothing.deviations.max() == pytest.approx(0.06, abs=0.01)
    assert allowed(clothing, CHEST) > 0.04**2
    assert (clothing.deviations > 0.02).sum() == 1


def test_wide_trousers_end_at_the_hem():
    vector = PRIOR.mean.vector.copy()
    vector[[QUANTITIES.index(f"{ball} radius") for ball in ("knee", "calf", "hem")]] += 0.06
    clothing = settled(vector)
    assert allowed(clothing, QUANTITIES.index("hem radius")) > 0.04**2
    assert allowed(clothing, QUANTITIES.index("ankle radius")) < 0.001**2


def test_clothes_shift_a_part_only_where_they_are_thick_and_never_far():
    face, front = (QUANTITIES.index(f"face {what}") for what in ("radius", "front"))
    vector = PRIOR.mean.vector.copy()
    vector[face] += 0.05
    thick = allowed(settled(vector), front)
    vector[front] += 0.13
    assert allowed(settled(PRIOR.mean.vector), front) < 0.003**2 < allowed(settled(vector), front) < 0.011**2
    assert thick < allowed(settled(vector), front)


def test_clothes_make_nothing_thinner():
    vector = PRIOR.mean.vector.copy()
    vector[CHEST] -= 0.06
    assert settled(vector).deviations.max() < 0.03
    assert allowed(settled(vector), CHEST) < 0.001**2


def test_dressed_adds_to_radii_but_of_hands_feet_and_bags():
    thicker = dressed(Shape.of(PRIOR.mean.vector), 0.03)
    grown = np.asarray(thicker.balls - PRIOR.mean.balls)
    np.testing.assert_array_equal(grown[:, :3], 0.0)
    bare = np.isin(
        FREE, ["palm", "finger", "ankle", "heel", "ball", "toe", "bag_top", "bag_low", "hair_top", "hair_low"]
    )
    np.testing.assert_allclose(grown[:, 3], np.where(bare, 0.0, 0.03), atol=1e-12)
    naked, clothed = measured_body(ADULT, PRIOR.mean), measured_body(ADULT, thicker)
    assert clothed.skeleton.stature == naked.skeleton.stature
