"""Elbows and knees bend one way, and only so far: the limits, computed by hand."""

import jax
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.phantoms import ideal_graph

from jaxskel import Pose, default_adult
from jaxskel.body import SEGMENT_NAMES
from jaxskel.refinement.parametrisations import HingedLimbs
from jaxskel.refinement.terms import AbstractTerm, HingeLimits, place

ADULT = default_adult()
HINGED = HingedLimbs()
REST = Pose(np.zeros(3), np.tile(np.eye(3), (17, 1, 1)))
AT_REST = place(ADULT, REST)
GRAPH = ideal_graph(ADULT, REST)
LIMITS = HingeLimits(skeleton=ADULT)
UNKNOWN_OF_HINGE = {"l_elbow": 17, "r_elbow": 23, "l_knee": 27, "r_knee": 31}  # of HingedLimbs


def bent(**angles) -> np.ndarray:
    """Residuals of a standing person with hinges flexed (rad); those not named by 0.5."""
    unknowns = np.zeros(42)
    for name, unknown in UNKNOWN_OF_HINGE.items():
        unknowns[unknown] = angles.get(name, 0.5)
    return np.asarray(residual_of(unknowns))


@jax.jit
def residual_of(unknowns):
    return LIMITS.residual(place(ADULT, HINGED.retract(unknowns, REST, ADULT)), GRAPH, None)


@pytest.mark.parametrize("hinge", UNKNOWN_OF_HINGE)
@pytest.mark.parametrize(
    ("angle", "beyond"),
    [(0.06, 0), (1.0, 0), (2.4, 0), (0.0, 0.05), (-0.4, 0.45), (-1.5, 1.55), (2.8, 0.3), (3.5, 1.0)],
)
def test_hinges_are_free_between_the_limits_and_punished_by_the_angle_beyond(hinge, angle, beyond):
    # The ankle stands less than a millimetre behind the straight thigh's line.
    slack = 0.002 if hinge.endswith("knee") else 1e-5
    residual = bent(**{hinge: angle})
    row = list(UNKNOWN_OF_HINGE).index(hinge)
    np.testing.assert_allclose(residual[row, 0], beyond, atol=slack)
    np.testing.assert_allclose(residual[:, 1], 0.0, atol=1e-6)
    np.testing.assert_array_equal(np.delete(residual[:, 0], row), 0.0)


def test_standing_straight_costs_next_to_nothing():
    # The foot in front of the ankle is no bend of the knee.
    residual = np.asarray(LIMITS.residual(AT_REST, GRAPH, None))
    assert residual.max() < 0.0501


def test_knees_to_the_front_are_punished_though_elbows_to_the_front_are_not():
    assert bent(l_knee=-1.0, r_knee=-1.0)[2:, 0].min() > 1
    np.testing.assert_allclose(bent(l_elbow=1.0, r_elbow=1.0), 0.0, atol=1e-6)
    # In the world: a shank turned so that the foot comes to the front.
    for degrees, punished in ((-60, True), (60, False)):
        pose = jax.tree.map(np.array, REST)
        turn = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
        pose.rotations[[SEGMENT_NAMES.index("l_shank"), SEGMENT_NAMES.index("l_foot")]] = turn
        residual = LIMITS.residual(place(ADULT, pose), GRAPH, None)
        assert (residual[2, 0] > 1.0) == punished


@pytest.mark.parametrize("angle", [0.3, -0.3])
def test_a_bend_to_the_side_is_punished_by_a_third_of_its_cosine(angle):
    # About the front, which for the arm is across the upper arm, and nearly so for the leg.
    pose = jax.tree.map(np.array, REST)
    pose.rotations[SEGMENT_NAMES.index("l_forearm")] = Rotation.from_rotvec([angle, 0, 0]).as_matrix()
    residual = np.asarray(LIMITS.residual(place(ADULT, pose), GRAPH, None))
    np.testing.assert_allclose(np.abs(residual[0]), [0.05, np.sin(0.3) / 3], atol=1e-6)
    np.testing.assert_allclose(residual[[1, 2, 3], 1], 0.0, atol=1e-6)


def test_terms_cost_the_squared_norm_unless_they_say_otherwise():
    assert HingeLimits.cost is AbstractTerm.cost
    pose = jax.tree.map(np.array, REST)
    pose.rotations[SEGMENT_NAMES.index("l_shank")] = Rotation.from_euler("y", -1.0).as_matrix()
    body = place(ADULT, pose)
    expected = (LIMITS.residual(body, GRAPH, None) ** 2).sum()
    assert expected > 1
    np.testing.assert_allclose(LIMITS.cost(body, GRAPH), expected, rtol=1e-6)
