"""Confidence of searched poses, by hand."""

import numpy as np
import pytest

from jaxskel.search import NOT_THE_SUBJECT, searched_confidence, trust_in_explained

DEAR = 20.0


def hypotheses(*elsewhere: bool) -> np.ndarray:
    """One frame; some hypotheses have the left hand in a different place than the first one."""
    joints = np.zeros((1, 1 + len(elsewhere), 15, 3))
    for number, away in enumerate(elsewhere, 1):
        joints[0, number, 5] = [0.0, 0.0, 0.2 * away]
        joints[0, number, 2] = [0.05, 0.0, 0.0]  # not far enough to be elsewhere
    return joints


def test_joints_on_which_all_agree_are_sure():
    np.testing.assert_allclose(searched_confidence(hypotheses(False, False), np.array([[5.0, 6.0, 9.0]]), DEAR), 1.0)


@pytest.mark.parametrize(("extra", "confidence"), [(0.0, 0.5), (4.0, 1 / (1 + np.exp(-1))), (400.0, 1.0)])
def test_a_rival_counts_by_what_it_costs_more(extra, confidence):
    trust = searched_confidence(hypotheses(True), np.array([[5.0, 5.0 + extra]]), DEAR)[0]
    assert trust[5] == pytest.approx(confidence, abs=1e-6)
    assert np.delete(trust, 5) == pytest.approx(1.0)


def test_a_cheaper_rival_leaves_little():
    assert searched_confidence(hypotheses(True), np.array([[15.0, 5.0]]), DEAR)[0, 5] < 0.1


def test_a_costly_pose_is_trusted_less_in_every_joint():
    trust = [searched_confidence(hypotheses(False), np.array([[c, c]]), DEAR)[0] for c in (20.0, 40.0, 1e9)]
    np.testing.assert_allclose(trust[0], 1.0)
    np.testing.assert_allclose(trust[1], np.exp(-1), rtol=1e-6)
    np.testing.assert_allclose(trust[2], 0.0)


def test_infinite_costs_are_no_rivals():
    assert searched_confidence(hypotheses(True), np.array([[5.0, np.inf]]), DEAR)[0, 5] == 1.0


def test_unexplained_outlines_lower_the_confidence_to_zero():
    shares = np.linspace(0, 0.6, 61)
    trust = trust_in_explained(shares)
    np.testing.assert_array_equal(trust[shares <= 0.125], 1.0)
    np.testing.assert_array_equal(trust[shares >= NOT_THE_SUBJECT], 0.0)
    between = trust[(shares > 0.125) & (shares < NOT_THE_SUBJECT)]
    assert (np.diff(between) < 0).all()
    assert trust_in_explained(np.array([(0.125 + NOT_THE_SUBJECT) / 2]))[0] == pytest.approx(0.5)
