from itertools import pairwise

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads
from scipy.spatial.transform import Rotation
from support.phantoms import HandsTogether, ideal_graph, pose_of

from jaxskel.body import HUMAN_15, JOINT_NAMES, SEGMENT_NAMES, Pose, default_adult, forward_kinematics
from jaxskel.refinement.parametrisations import ExactBones
from jaxskel.refinement.terms import (
    EndNodeAttraction,
    GraphAttraction,
    InnerNodeAttraction,
    Objective,
    RestPrior,
    firmness,
    paper_objective,
    place,
)

ADULT = default_adult()
BONES = ExactBones()
UNKNOWNS = 31


def rigid_pose() -> Pose:
    turn = Rotation.from_euler("zx", (1.0, 0.2)).as_matrix()
    return Pose(np.array([0.3, -0.2, 0.9]), np.tile(turn, (17, 1, 1)))


def held_stick() -> float:
    joints, _ = forward_kinematics(ADULT, pose_of(2))
    return float(np.linalg.norm(joints[5] - joints[8]))


# Term, a pose at which it is satisfied, shape of its residual.
TERMS = {
    "graph": (GraphAttraction(), pose_of(2), (10, 7)),
    "end nodes": (EndNodeAttraction(), pose_of(2), (5, 3)),
    "inner nodes": (InnerNodeAttraction(), pose_of(2), (2, 3)),
    "rest": (RestPrior(), rigid_pose(), (16, 4)),
    "custom": (HandsTogether(length=held_stick()), pose_of(2), ()),
}


@pytest.mark.parametrize("name", TERMS)
def test_terms_vanish_at_the_truth_only(name):
    term, truth, shape = TERMS[name]
    observed = ideal_graph(ADULT, truth)

    @jax.jit
    def residual(pose):
        body = place(ADULT, pose)
        return term.residual(body, observed, term.correspond(body, observed))

    assert residual(truth).shape == shape
    np.testing.assert_allclose(residual(truth), 0.0, atol=2e-6)
    assert np.isfinite(residual(pose_of(7))).all()
    assert np.abs(residual(pose_of(7))).max() > 0.02


@pytest.mark.slow
@pytest.mark.parametrize("name", TERMS)
def test_jacobians_of_terms_are_finite_differences(name):
    term, base, observed = TERMS[name][0], pose_of(4), ideal_graph(ADULT, pose_of(2))
    with jax.enable_x64(True):
        term, base, observed, skeleton = jax.tree.map(
            lambda a: a if a.dtype == bool else jnp.asarray(a, jnp.float64), (term, base, observed, ADULT)
        )
        fixed = term.correspond(place(skeleton, base), observed)

        @jax.jit
        def residual(unknowns):
            # The finite differences come as NumPy arrays.
            return term.residual(place(skeleton, BONES.retract(jnp.asarray(unknowns), base, skeleton)), observed, fixed)

        unknowns = 0.1 * jnp.asarray(np.random.default_rng(0).normal(size=UNKNOWNS))
        check_grads(residual, (unknowns,), order=1, modes=("fwd", "rev"), atol=1e-6, rtol=1e-6, eps=1e-5)
        assert jnp.abs(jax.jacfwd(residual)(unknowns)).max() > 0.1


def test_limbs_that_were_not_found_pull_at_nothing():
    observed = eqx.tree_at(
        lambda o: o.found, ideal_graph(ADULT, pose_of(2)), jnp.asarray([True, False, True, True, False])
    )
    body = place(ADULT, pose_of(4))
    ends = EndNodeAttraction().residual(body, observed, None)
    np.testing.assert_array_equal((np.asarray(ends) != 0).any(1), [True, False, True, True, False])
    moved = eqx.tree_at(lambda o: o.paths, observed, observed.paths.at[jnp.asarray([1, 4])].add(0.3))
    graph = GraphAttraction()
    for seen in (observed, moved):
        residual = graph.residual(body, seen, graph.correspond(body, seen))
        np.testing.assert_array_equal(residual, graph.residual(body, observed, graph.correspond(body, observed)))


def closest_point(path: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Closest point of a polyline, segment by segment."""
    shares = [np.clip((point - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0, 1) for a, b in pairwise(path)]
    places = [a + share * (b - a) for share, (a, b) in zip(shares, pairwise(path), strict=True)]
    return min(places, key=lambda place: float(np.linalg.norm(place - point)))


def test_five_samples_of_a_bone_are_drawn_to_the_path_of_its_limb():
    looked_up, moved = place(ADULT, pose_of(4)), place(ADULT, pose_of(5))
    observed = ideal_graph(ADULT, pose_of(2))
    graph = GraphAttraction()
    residual = np.asarray(graph.residual(moved, observed, graph.correspond(looked_up, observed)))
    # The joint that a bone ends in, the one it begins in, the row of the bone, and of its path.
    bones = (
        ("neck", "pelvis", 0, 3), ("l_elbow", "l_shoulder", 2, 1), ("r_hand", "r_elbow", 5, 2),
        ("l_knee", "l_hip", 6, 3), ("r_foot", "r_knee", 9, 4),
    )  # fmt: skip
    for name, start, row, path in bones:
        ends = [JOINT_NAMES.index(start), JOINT_NAMES.index(name)]
        (a, b), (c, d) = (np.asarray(body.joints, float)[ends] for body in (looked_up, moved))
        expected = 0.0
        # The foot's joint is its ball: the graph leaves the bone at the ankle.
        for share in np.linspace(0.0, 0.4, 5) if name == "r_foot" else np.linspace(0.2, 1.0, 5):
            sample = (1 - share) * a + share * b
            goal = closest_point(np.asarray(observed.paths, float)[path], sample)
            weight = 1 / (1 + ((goal - sample) ** 2).sum() / 0.1**2)
            expected += weight**2 * (((1 - share) * c + share * d - goal) ** 2).sum()
        np.testing.assert_allclose((residual[row] ** 2).sum(), expected / 5, rtol=1e-4)


def test_a_weight_multiplies_the_squared_norm():
    body, observed = place(ADULT, pose_of(4)), ideal_graph(ADULT, pose_of(2))
    costs = []
    for weight in (1.0, 9.0):
        objective = Objective({"ends": EndNodeAttraction(weight=weight)})
        costs.append((objective.residuals(body, observed, objective.correspond(body, observed))["ends"] ** 2).sum())
    np.testing.assert_allclose(costs[1], 9 * costs[0], rtol=1e-6)


def test_costs_are_weighted_squared_norms():
    body, observed = place(ADULT, pose_of(4)), ideal_graph(ADULT, pose_of(2))
    objective = paper_objective()
    residuals = objective.residuals(body, observed, objective.correspond(body, observed))
    costs = objective.costs(body, observed)
    assert set(costs) == set(residuals)
    for name, cost in costs.items():
        np.testing.assert_allclose(cost, (residuals[name] ** 2).sum(), rtol=1e-5)


def test_rest_prior_by_hand():
    # A forearm turned by 1 rad about y, at rest otherwise: the hand, which is not turned, is by -1 rad against it.
    prior = RestPrior(firmness=firmness(hand=3.0, forearm=2.0, upper_arm=0.5))
    turned = Pose(np.zeros(3), np.tile(np.eye(3), (17, 1, 1)))
    turned.rotations[SEGMENT_NAMES.index("l_forearm")] = Rotation.from_euler("y", 1.0).as_matrix()
    residual = np.asarray(prior.residual(place(ADULT, turned), ideal_graph(ADULT, turned), None))
    expected = np.zeros((17, 4))
    expected[SEGMENT_NAMES.index("l_forearm")] = 2 * np.array([0, np.sin(1.0), 0, 1 - np.cos(1.0)])  # sqrt(2 * 2)
    expected[SEGMENT_NAMES.index("l_hand")] = np.sqrt(6) * np.array([0, -np.sin(1.0), 0, 1 - np.cos(1.0)])
    np.testing.assert_allclose(residual, expected[1:], atol=1e-5)


@pytest.mark.parametrize("angle", [0.01, 0.5, 2.0, np.pi])
def test_rest_prior_has_the_norm_of_the_difference_of_rotations(angle):
    # Also for a half turn, whose sine is zero, and for any rotation of the parent.
    pose = rigid_pose()
    upper, lower = (SEGMENT_NAMES.index(name) for name in ("r_upper_arm", "r_forearm"))
    turn = Rotation.from_rotvec(angle * np.array([0.48, -0.6, 0.64])).as_matrix()
    pose.rotations[lower] = pose.rotations[upper] @ turn
    residual = RestPrior(firmness=firmness(forearm=1.0)).residual(place(ADULT, pose), ideal_graph(ADULT, pose), None)
    expected = np.zeros(17)
    expected[lower] = np.linalg.norm(turn - np.eye(3))
    np.testing.assert_allclose(np.linalg.norm(residual, axis=1), expected[1:], atol=1e-5)
    np.testing.assert_allclose(expected[lower], 2 * np.sqrt(2) * np.sin(angle / 2))


def test_firmness_names_both_sides():
    firm = dict(zip(SEGMENT_NAMES[1:], firmness(chest=1.0, foot=2.0), strict=True))
    assert {name: value for name, value in firm.items() if value} == {"chest": 1.0, "l_foot": 2.0, "r_foot": 2.0}
    # The paper's objective does not look at hands and feet: its residuals there must leave the solver alone.
    rest = dict(zip(SEGMENT_NAMES[1:], HUMAN_15.firmness, strict=True))
    assert all(rest[side + name] == 0 for side in ("l_", "r_") for name in ("hand", "foot"))
