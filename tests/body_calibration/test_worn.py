"""What is worn around each joint: what no flesh explains."""

import equinox as eqx
import numpy as np
import pytest
from support.people import ADULT

from jaxskel.body import BALL_NAMES, JOINT_NAMES, Body, flesh_prior, measured_body
from jaxskel.body_calibration import dressed, worn_around_joints

USUAL = flesh_prior(ADULT).mean


def worn(body: Body) -> dict[str, float]:
    return dict(zip(JOINT_NAMES, worn_around_joints(body), strict=True))


def thicker(by: float, *balls: str) -> Body:
    body = measured_body(ADULT, USUAL)
    wears = np.array([name.removeprefix("l_").removeprefix("r_") in balls for name in BALL_NAMES])
    return eqx.tree_at(lambda b: b.radii, body, body.radii + by * wears)


def test_naked_people_wear_nothing():
    for naked in (measured_body(ADULT, USUAL), thicker(-0.02, "waist", "chest", "hip")):
        np.testing.assert_allclose(worn_around_joints(naked), 0.0, atol=2e-3)


def test_everywhere_equally_thick_is_that_thick_around_each_joint_of_a_clothed_part():
    found = worn(measured_body(ADULT, dressed(USUAL, 0.06)))
    for joint in ("neck", "head", "l_shoulder", "r_elbow", "l_knee"):
        assert 0.045 < found[joint] < 0.0601
    # Ankles, seat and waist: bare, or of people of very different sizes.
    assert all(0.02 < thickness < 0.0601 for thickness in found.values())


@pytest.mark.parametrize(
    ("balls", "hidden"),
    [
        (("face", "crown"), {"head"}),
        (("knee", "calf"), {"l_knee", "r_knee", "l_foot", "r_foot"}),
        (("forearm",), {"l_elbow", "r_elbow", "l_hand", "r_hand"}),
    ],
)
def test_only_the_joints_near_thick_parts_are_hidden(balls, hidden):
    found = worn(thicker(0.05, *balls))
    assert {joint for joint, thickness in found.items() if thickness > 0.005} == hidden


def test_left_and_right_are_equal():
    found = worn(measured_body(ADULT, dressed(USUAL, 0.04)))
    for joint in ("shoulder", "elbow", "hand", "hip", "knee", "foot"):
        assert found[f"l_{joint}"] == found[f"r_{joint}"]
