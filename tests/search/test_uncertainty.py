"""Uncertainty of searched poses: by hand, and against random draws."""

import numpy as np
import pytest

from jaxskel import JOINT_NAMES
from jaxskel._math.gaussians import deviation_for, probability_within
from jaxskel.search import NOT_THE_SUBJECT, Uncertainty, searched_uncertainty, trust_in_explained

USUAL = 20.0
SEEN = np.tile(0.03**2 * np.eye(3), (1, 15, 1, 1))  # as wide as the normal equations say of a limb that is seen


def hypotheses(*elsewhere: bool) -> np.ndarray:
    """One frame; some hypotheses have the left hand in a different place than the first one."""
    joints = np.zeros((1, 1 + len(elsewhere), 15, 3))
    for number, away in enumerate(elsewhere, 1):
        joints[0, number, 5] = [0.0, 0.0, 0.2 * away]
        joints[0, number, 2] = [0.05, 0.0, 0.0]  # not far enough to be elsewhere
    return joints


def uncertainty(joints: np.ndarray, *costs: float, covariance: np.ndarray = SEEN, unexplained=0.0) -> Uncertainty:
    return searched_uncertainty(joints, np.array([costs]), covariance, USUAL, np.array([unexplained]))


def test_joints_on_which_all_agree_are_sure():
    found = uncertainty(hypotheses(False, False), 5.0, 6.0, 9.0)
    assert (found.confidence > 0.99).all()
    deviation = np.sqrt(np.trace(found.covariance, axis1=-2, axis2=-1) / 3)
    assert (deviation[0, [0, 5, 11]] > 0.003).all()
    assert (deviation < 0.03).all()


def test_confidence_is_a_probability_in_spite_of_rounding():
    random = np.random.default_rng(0)
    joints = np.zeros((200, 8, 15, 3))
    costs, covariance = random.uniform(0, 3, (200, 8)), np.tile(0.001**2 * np.eye(3), (200, 15, 1, 1))
    found = searched_uncertainty(joints, costs.astype(np.float32), covariance, USUAL, np.zeros(200))
    assert found.confidence.max() <= 1.0
    assert found.confidence.min() > 0.99


@pytest.mark.parametrize(("extra", "confidence"), [(0.0, 0.5), (0.7, 1 / (1 + np.exp(-1))), (400.0, 1.0)])
def test_a_rival_counts_by_what_it_costs_more(extra, confidence):
    trust = uncertainty(hypotheses(True), 5.0, 5.0 + extra).confidence[0]
    assert trust[5] == pytest.approx(confidence, abs=1e-3)
    assert np.delete(trust, 5) == pytest.approx(1.0, abs=1e-3)


def test_a_rival_that_faces_the_other_way_counts_more_the_less_a_body_explains():
    def trust(threshold: float, turned: bool) -> float:
        joints, costs = hypotheses(True), np.array([[5.0, 10.0]])
        return searched_uncertainty(
            joints, costs, SEEN, threshold, np.zeros(1), turned=np.array([[False, turned]])
        ).confidence[0, 5]

    assert trust(USUAL, False) == trust(50.0, False) > 0.99
    np.testing.assert_allclose([trust(USUAL, True), trust(50.0, True)], 1 / (1 + np.exp([-5 / 2, -5 / 5])), atol=1e-3)


def test_a_rival_widens_the_covariance_towards_it_alone():
    alone, rivalled = (uncertainty(hypotheses(True), 5.0, 5.0 + extra).covariance[0, 5] for extra in (1e9, 0.0))
    np.testing.assert_allclose(rivalled - alone, np.diag([0, 0, 0.5 * 0.2**2]), atol=1e-6)


def test_a_cheaper_rival_leaves_little():
    assert uncertainty(hypotheses(True), 15.0, 5.0).confidence[0, 5] < 0.1


def test_a_costly_pose_is_trusted_less_in_every_joint():
    found = [uncertainty(hypotheses(False), cost, cost) for cost in (20.0, 40.0, 1e9)]
    trust = [each.confidence[0] for each in found]
    assert (trust[0] > trust[1]).all()
    assert (trust[1] > trust[2]).all()
    assert trust[2].max() < 0.5
    assert np.isfinite(found[2].covariance).all()


def test_infinite_costs_are_no_rivals():
    assert uncertainty(hypotheses(True), 5.0, np.inf).confidence[0, 5] > 0.99


def test_a_limb_that_hardly_any_outline_touches_is_not_sure():
    trust = [uncertainty(hypotheses(False), 5.0, 5.0, covariance=k**2 * SEEN).confidence[0, 5] for k in (1, 2, 3)]
    assert trust[0] > 0.99
    assert trust[1] < 0.9
    # As likely as to be within one standard deviation in three dimensions.
    assert trust[2] == pytest.approx(0.2, abs=0.01)


@pytest.mark.parametrize(("cost", "limit", "surest"), [(5.0, 0.1, 0.21), (300.0, 1.0, 0.02)])
def test_what_nothing_shows_is_off_by_no_more_than_an_arm_usually_is_or_than_a_body_is_long(cost, limit, surest):
    """Without a bound, deviations went to kilometres, which no reader of the files takes for metres."""
    for deviation in (0.3, 1.0, 30.0):
        wide = np.tile(deviation**2 * np.eye(3), (1, 15, 1, 1))
        found = uncertainty(hypotheses(False), cost, 1e9, covariance=wide)
        spread = np.sqrt(np.trace(found.covariance, axis1=-2, axis2=-1) / 3)
        np.testing.assert_allclose(spread[0], limit, atol=0.01 * limit)
        assert found.confidence.max() < surest


def test_what_the_subject_does_not_explain_makes_unsure():
    trust = [uncertainty(hypotheses(False), 5.0, 5.0, unexplained=share).confidence[0, 5] for share in (0.1, 0.3, 0.4)]
    assert trust[0] > 0.99
    assert trust[0] > trust[1] > trust[2]
    assert trust[2] < 0.5


@pytest.mark.parametrize(("offset", "deviation"), [(0.0, 0.03), (0.05, 0.02), (0.1, 0.05), (0.3, 0.1), (0.1, 1e-4)])
def test_the_probability_is_the_share_of_random_draws(offset, deviation):
    draws = np.random.default_rng(0).normal(size=(200_000, 3)) * deviation + [0, offset, 0]
    share = (np.linalg.norm(draws, axis=1) < 0.1).mean()
    assert probability_within(0.1, np.array([offset]), np.array([deviation])) == pytest.approx(share, abs=5e-3)


@pytest.mark.parametrize("probability", [0.05, 0.5, 0.95])
def test_a_deviation_gives_back_its_probability(probability):
    deviation = deviation_for(0.1, np.array([probability]))
    assert probability_within(0.1, np.zeros(1), deviation) == pytest.approx(probability, abs=1e-5)


def test_unexplained_outlines_lower_the_confidence_to_zero():
    shares = np.linspace(0, 0.6, 61)
    trust = trust_in_explained(shares)
    np.testing.assert_array_equal(trust[shares <= 0.125], 1.0)
    np.testing.assert_array_equal(trust[shares >= NOT_THE_SUBJECT], 0.0)
    between = trust[(shares > 0.125) & (shares < NOT_THE_SUBJECT)]
    assert (np.diff(between) < 0).all()
    assert trust_in_explained(np.array([(0.125 + NOT_THE_SUBJECT) / 2]))[0] == pytest.approx(0.5)


def test_clothes_widen_all_joints_and_bring_rivals_nearer():
    joints, costs = hypotheses(True), np.array([[5.0, 6.0]])
    naked, clothed = (searched_uncertainty(joints, costs, SEEN, USUAL, np.zeros(1), clothes) for clothes in (0.0, 0.07))
    # Twice the thickness that doubles the variance: five times the variance, less where it nears its limit. Of elbows
    # and hands, a part of it does not depend on clothes.
    alone = [joint for joint, name in enumerate(JOINT_NAMES) if not name.endswith(("elbow", "hand"))]
    times = clothed.covariance[0, alone, 1, 1] / naked.covariance[0, alone, 1, 1]
    assert times.max() == pytest.approx(5.0, abs=0.1)
    assert times.min() > 4.4
    assert clothed.confidence[0, 5] < naked.confidence[0, 5] - 0.1


def test_a_joint_is_as_uncertain_as_what_is_worn_around_it_is_thick():
    joints, costs, worn = hypotheses(False), np.array([[5.0, 5.0]]), np.zeros(15)
    worn[2] = 0.1  # the head, under a hood
    bare, hooded, twice = (
        searched_uncertainty(joints, costs, SEEN, USUAL, np.zeros(1), 0.0, k * worn) for k in range(3)
    )
    added, doubled = (found.covariance[0] - bare.covariance[0] for found in (hooded, twice))
    np.testing.assert_allclose(np.delete(added, 2, axis=0), 0.0)
    assert 0.05**2 < added[2, 0, 0] < 0.1**2
    np.testing.assert_allclose(added[2], added[2, 0, 0] * np.eye(3), atol=1e-8)
    np.testing.assert_allclose(doubled[2], 4 * added[2], rtol=1e-4)
    assert bare.confidence[0, 2] > 0.99
    assert hooded.confidence[0, 2] < 0.7
    assert twice.confidence[0, 2] < 0.3


def test_where_no_body_explains_the_silhouettes_nothing_is_sure():
    joints, costs = hypotheses(False), np.array([[100.0, 100.0]])
    explained, beyond = (searched_uncertainty(joints, costs, SEEN, usual, np.zeros(1)) for usual in (110.0, 220.0))
    np.testing.assert_allclose(beyond.covariance[0, 1], 4**2 * explained.covariance[0, 1], rtol=1e-5)
    assert (beyond.confidence < explained.confidence).all()


@pytest.mark.parametrize(("extra", "facing"), [(0.0, 0.5), (2.0, 1 / (1 + np.exp(-1))), (100.0, 1.0)])
def test_left_and_right_are_as_sure_as_the_way_that_the_person_faces(extra, facing):
    def told(turned: bool) -> float:
        costs = np.array([[5.0, 5.0 + extra]])
        found = searched_uncertainty(
            hypotheses(True), costs, SEEN, USUAL, np.zeros(1), turned=np.array([[False, turned]])
        )
        return float(found.facing[0])

    assert told(True) == pytest.approx(facing, abs=1e-6)
    assert told(False) == 1.0
