"""Flesh around a known skeleton does not depend on the pose that the skeleton was measured in."""

import numpy as np
import pytest
from jaxtyping import Float

from jaxskel import Skeleton, default_adult, make_skeleton
from jaxskel._math.rotations import turn_about
from jaxskel.body import (
    BALL_NAMES,
    FLESH_FROM,
    FREE_BALLS,
    LENGTH_NAMES,
    SEGMENT_NAMES,
    Pose,
    flesh_prior,
    forward_kinematics,
    measured_body,
    people_prior,
)

ADULT = default_adult(1.7)
ARM = ("upper_arm", "forearm", "hand")
TURN = turn_about(np.array([[1.0, 0.0, 0.0]]), np.radians([40.0]))[0]
FREE = list(FREE_BALLS)


def _with_raised_arms() -> Skeleton:
    """The adult, measured with both arms 70 degrees away from the trunk instead of 30."""
    rotations = np.tile(np.eye(3), (len(SEGMENT_NAMES), 1, 1))
    for number, segment in enumerate(SEGMENT_NAMES):
        if segment.removeprefix("l_") in ARM:
            rotations[number] = TURN
        if segment.removeprefix("r_") in ARM:
            rotations[number] = TURN.T
    joints, tips = forward_kinematics(ADULT, Pose(np.zeros(3), rotations))
    return make_skeleton(np.asarray(joints), np.asarray(tips))


def _offsets(skeleton: Skeleton) -> Float[np.ndarray, "balls 3"]:
    return np.asarray(measured_body(skeleton, flesh_prior(skeleton).mean).offsets)


def test_flesh_of_arms_turns_with_them():
    usual, raised = _offsets(ADULT), _offsets(_with_raised_arms())
    left = [ball for ball, name in enumerate(BALL_NAMES) if name in ("l_shoulder", "l_elbow", "l_forearm", "l_wrist")]
    assert np.abs(usual[left] - raised[left]).max() > 0.005
    assert raised[left] == pytest.approx(usual[left] @ TURN.T, abs=1e-5)
    legs = [ball for ball, name in enumerate(BALL_NAMES) if name in ("l_hip", "l_knee", "l_calf", "l_heel", "l_toe")]
    assert raised[legs] == pytest.approx(usual[legs], abs=1e-5)


def test_toes_turned_at_rest_are_not_turned_once_more():
    """As in skinned bodies, whose big toe points inwards: the tip that was measured moves, the flesh stays."""
    tips = np.array(ADULT.rest_tips)
    tips[3:, 1] -= [0.025, -0.025]
    toe = BALL_NAMES.index("l_toe")
    assert _offsets(make_skeleton(ADULT.rest_joints, tips))[toe] == pytest.approx(_offsets(ADULT)[toe], abs=2e-3)


def test_deviations_turn_with_the_arm():
    usual, raised = (np.linalg.inv(flesh_prior(each).precision) for each in (ADULT, _with_raised_arms()))
    first = FLESH_FROM + 4 * FREE.index(BALL_NAMES.index("l_forearm"))
    of_ball = slice(first, first + 3)
    assert raised[of_ball, of_ball] == pytest.approx(TURN @ usual[of_ball, of_ball] @ TURN.T, rel=1e-3, abs=1e-8)


def test_around_the_usual_adult_it_is_what_people_with_these_lengths_have():
    """Of several jointly normal quantities, those given fix the mean of the others."""
    people, flesh = people_prior(ADULT, ADULT.stature), flesh_prior(ADULT)
    covariance = np.linalg.inv(people.precision + 1e-3 * np.eye(len(people.precision)))
    known, free = slice(0, len(LENGTH_NAMES)), slice(FLESH_FROM, None)
    gain = covariance[free, known] @ np.linalg.inv(covariance[known, known])
    mean = people.mean.vector[free] - gain @ people.mean.lengths
    assert flesh.mean.vector[free] == pytest.approx(mean, abs=1e-3)
    assert flesh.mean.vector[:FLESH_FROM] == pytest.approx(np.zeros(FLESH_FROM))
