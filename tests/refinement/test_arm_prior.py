"""The prior of arms: a density over directions, alike for both sides, and what it costs in clothes."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.observed_person import ADULT, BODY, HINGED, UNKNOWNS, standing, turned
from support.phantoms import ideal_graph

from jaxskel.body import MIRROR_JOINTS, place_joints
from jaxskel.refinement.terms import arm_directions, arm_prior, place, search_objective, usual_arms
from jaxskel.search import make_model, prior_in_clothes

PRIOR = usual_arms()
# The term looks at nothing.
NOTHING = ideal_graph(ADULT, standing())
HANGING = np.array([0.0, 0.1, -1.0, 0.3, 0.0, -0.95])
BEHIND_HEAD = np.array([-0.3, 0.9, 0.3, -0.3, -0.8, 0.5])


def units(directions: np.ndarray) -> np.ndarray:
    pairs = directions.reshape(-1, 2, 3)
    return (pairs / np.linalg.norm(pairs, axis=-1, keepdims=True)).reshape(-1, 6)


def anywhere(count: int) -> np.ndarray:
    return units(np.random.default_rng(0).normal(size=(count, 6)))


def costs(prior, pose) -> np.ndarray:
    return np.asarray(residual(prior, pose)) ** 2


@eqx.filter_jit
def residual(prior, pose):
    return prior.residual(place(ADULT, pose), NOTHING, None)


def cost_of(directions: np.ndarray) -> np.ndarray:
    found = PRIOR.posture_costs("arm", units(directions))
    assert found is not None
    return found


def test_the_density_is_one():
    densities = np.exp(float(PRIOR.top) - cost_of(anywhere(50_000)))
    assert densities.mean() == pytest.approx(1.0, abs=0.1)
    # Arms that are held in no usual way have a share of their own.
    assert densities.min() == pytest.approx(0.05, abs=0.01)


def test_nothing_costs_less_than_the_most_usual_posture():
    found = cost_of(np.concatenate([anywhere(1000), np.asarray(PRIOR.means)]))
    assert found.min() >= 0
    assert cost_of(np.asarray(PRIOR.means)).min() < 0.2


def test_hanging_arms_are_more_usual_than_hands_behind_the_head():
    assert cost_of(HANGING)[0] + 2 < cost_of(BEHIND_HEAD)[0]


def test_legs_cost_nothing():
    assert PRIOR.posture_costs("leg", anywhere(3)) is None


@pytest.mark.parametrize("turn", ["l_upper_arm", "r_forearm"])
def test_where_a_person_is_and_faces_does_not_matter(turn):
    pose = turned(turn, "x", 50)
    whole = Rotation.from_euler("zyx", [70, 20, -120], degrees=True).as_matrix().astype(np.float32)
    moved = type(pose)(whole @ pose.root + 1, whole @ pose.rotations)
    directions, others = (
        np.asarray(arm_directions(place_joints(ADULT, jax.tree.map(lambda a: a[None], each))[0]))
        for each in (pose, moved)
    )
    np.testing.assert_allclose(directions, others, atol=1e-5)


def test_a_mirrored_person_costs_the_same():
    joints = np.asarray(place(ADULT, turned("l_upper_arm", "x", 50)).joints)
    mirrored = joints[list(MIRROR_JOINTS)] * [1, -1, 1]
    directions, others = (np.asarray(arm_directions(each)) for each in (joints, mirrored))
    np.testing.assert_allclose(directions, others[::-1], atol=1e-5)


def test_a_posture_costs_as_much_in_the_table_as_in_the_fit():
    pose = turned("l_upper_arm", "x", 50)
    directions = np.asarray(arm_directions(place(ADULT, pose).joints))
    np.testing.assert_allclose(costs(PRIOR, pose), cost_of(directions), rtol=1e-3, atol=1e-4)


def test_jacobians_are_finite_differences():
    with jax.enable_x64(True):
        double = lambda a: jnp.asarray(a, jnp.float64) if np.asarray(a).dtype == np.float32 else a  # noqa: E731
        prior, skeleton, base = jax.tree.map(double, (PRIOR, ADULT, turned("l_upper_arm", "x", 50)))

        def residuals(unknowns):
            return prior.residual(place(skeleton, HINGED.retract(unknowns, base, skeleton)), NOTHING, None)

        rng = np.random.default_rng(0)
        here, along = (jnp.asarray(spread * rng.normal(size=UNKNOWNS)) for spread in (0.01, 1.0))
        # In one program: operation by operation, each is compiled.
        value, slope = jax.jit(lambda here: jax.jvp(residuals, (here,), (along,)))(here)
        found = jax.jit(residuals)
        divided = (found(here + 1e-6 * along) - found(here - 1e-6 * along)) / 2e-6
        np.testing.assert_allclose(slope, divided, atol=1e-6)
        assert np.abs(slope).min() > 1e-3
        # Backwards, too, for those who want gradients of their own.
        backwards = jax.jit(jax.grad(lambda u: (residuals(u) ** 2).sum()))(here)
        np.testing.assert_allclose(backwards @ along, 2 * value @ slope, rtol=1e-6)


def test_a_prior_of_one_posture_is_content_with_it_only():
    pose = standing()
    directions = np.asarray(arm_directions(place(ADULT, pose).joints))
    own = arm_prior(directions, np.ones(2))
    assert costs(own, pose).max() < 0.1
    assert costs(own, turned("l_upper_arm", "x", 60))[0] > 2


def test_only_the_prior_is_a_prior():
    objective = search_objective(BODY)
    clothed = objective.with_prior(2.5)
    for name, term in objective.of_frames.items():
        factor = 2.5 if name == "arms" else 1.0
        assert float(clothed.of_frames[name].weight) == pytest.approx(factor * float(term.weight)), name


def test_the_search_of_clothed_people_counts_priors_more():
    naked, clothed = make_model(BODY), make_model(BODY, prior=prior_in_clothes(0.035))
    np.testing.assert_allclose(clothed.limbs["l_arm"].costs, 2**0.5 * np.asarray(naked.limbs["l_arm"].costs), rtol=1e-5)
    np.testing.assert_allclose(naked.limbs["l_arm"].costs, naked.limbs["r_arm"].costs, atol=1e-3)
    assert not np.any(naked.limbs["l_leg"].costs)
