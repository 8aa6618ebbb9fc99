"""A body with volume against its silhouettes and its hull: the terms that are built on them, and their objective."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.observed_person import ADULT, BODY, HINGED, UNKNOWNS, observe, standing, turned
from support.phantoms import pose_of

from jaxskel import Pose
from jaxskel.body import SEGMENT_NAMES
from jaxskel.refinement.terms import (
    ArmCollision,
    ContourContact,
    HingeLimits,
    HipLimits,
    InsideSilhouettes,
    ShoulderLimits,
    place,
    volume_objective,
)
from jaxskel.search._gauss_newton import descend


@pytest.fixture(scope="module")
def observed():
    return observe(standing())


@eqx.filter_jit
def norm(term, pose, observed):
    body = place(ADULT, pose)
    return jnp.linalg.norm(term.residual(body, observed, term.correspond(body, observed)))


# Term, bound of its residual at the truth (voxels are 20 mm, pixels 11 mm), a pose with a large residual.
TERMS = {
    "contours": (ContourContact(body=BODY, scale=1.0), 0.005, turned("l_upper_arm", "x", 40)),
    "silhouettes": (InsideSilhouettes(body=BODY), 0.003, turned("l_upper_arm", "x", 40)),
    "collision": (ArmCollision(body=BODY), 0.001, turned("l_forearm", "x", -75)),
    "hinges": (HingeLimits(skeleton=ADULT), 1e-6, turned("l_shank", "y", -60)),
    "shoulders": (ShoulderLimits(skeleton=ADULT), 1e-6, turned("l_upper_arm", "y", 70)),
    "hips": (HipLimits(), 1e-6, turned("l_thigh", "y", 60)),
}


@pytest.mark.parametrize("name", TERMS)
def test_terms_are_content_with_the_truth_only(observed, name):
    term, bound, wrong = TERMS[name]
    assert norm(term, standing(), observed) < bound
    assert norm(term, wrong, observed) > 2 * bound


@pytest.mark.slow
def test_jacobians_of_terms_are_finite_differences(observed):
    # Contacts and hinges have tests of their own.
    terms = {name: TERMS[name][0] for name in ("silhouettes", "collision")}
    with jax.enable_x64(True):
        double = lambda a: jnp.asarray(a, jnp.float64) if np.asarray(a).dtype == np.float32 else a  # noqa: E731
        terms, seen, skeleton = jax.tree.map(double, (terms, observed, ADULT))
        # An arm that sticks out of the silhouettes, a forearm in the trunk.
        base = turned("l_forearm", "x", -75)
        out = SEGMENT_NAMES.index("r_upper_arm")
        base.rotations[out] = Rotation.from_euler("x", -30, degrees=True).as_matrix() @ base.rotations[out]
        base = jax.tree.map(double, base)
        rng = np.random.default_rng(0)
        here, along = (jnp.asarray(spread * rng.normal(size=UNKNOWNS)) for spread in (0.01, 1.0))

        @jax.jit
        def slopes(here, along, seen):
            fixed = {name: term.correspond(place(skeleton, base), seen) for name, term in terms.items()}

            def residuals(unknowns):
                body = place(skeleton, HINGED.retract(unknowns, base, skeleton))
                return {name: term.residual(body, seen, fixed[name]) for name, term in terms.items()}

            ahead, behind = (residuals(here + sign * 1e-6 * along) for sign in (1, -1))
            divided = jax.tree.map(lambda a, b: (a - b) / 2e-6, ahead, behind)
            return jax.jvp(residuals, (here,), (along,))[1], divided

        derived, divided = slopes(here, along, seen)
        for name, slope in derived.items():
            np.testing.assert_allclose(slope, divided[name], atol=1e-6, err_msg=name)
            assert np.abs(slope).max() > 1e-3, name


# Each foot starts nearer to its own place than to the other's, as the objective asks for.
SEEDS = (0, 1, 4, 5, 7, 8)


@pytest.mark.slow
def test_silhouettes_alone_recover_poses_and_a_wrong_one_costs_more():
    truth = turned("l_upper_arm", "x", 40)
    joints = np.asarray(place(ADULT, truth).joints)
    unknowns = np.stack([0.15 * np.random.default_rng(seed).normal(size=UNKNOWNS) for seed in SEEDS])
    # Unknowns that move the feet far (position, pelvis, chest and thighs) change by less than the rest.
    unknowns[:, np.r_[0:9, 24:27, 28:31]] *= 0.3
    start = jax.vmap(lambda u: HINGED.retract(u, jax.tree.map(jnp.asarray, truth), ADULT))(
        jnp.asarray(unknowns, jnp.float32)
    )
    started = np.asarray(jax.vmap(lambda pose: place(ADULT, pose).joints)(start))
    for foot, other in ((11, 14), (14, 11)):
        apart = (np.linalg.norm(started[:, foot] - joints[goal], axis=1) for goal in (foot, other))
        assert np.less(*apart).all()
    seen = jax.tree.map(lambda a: jnp.broadcast_to(jnp.asarray(a), (len(SEEDS), *a.shape)), observe(truth))
    found, objective = start, volume_objective(BODY)

    @jax.jit
    @jax.vmap
    def step(pose, observed):
        pose = descend(objective, HINGED, ADULT, pose, observed)
        body = place(ADULT, pose)
        return pose, body.joints, sum(objective.costs(body, observed).values())

    for _ in range(25):
        found, reached, cost = step(found, seen)
    before, after = (np.linalg.norm(np.asarray(j) - joints[None], axis=2).max(1) for j in (started, reached))
    assert before.min() > 0.1
    right = after < 0.01
    # The solver only descends, so a foot may be caught between both legs.
    assert right.sum() >= len(SEEDS) - 1
    cost = np.asarray(cost)
    assert cost[right].max() < 2
    assert (cost[~right] > 10 * cost[right].max()).all()


def test_poses_of_random_limbs_cost_more_than_the_truth(observed):
    objective = volume_objective(BODY)
    cost = jax.jit(lambda pose: sum(objective.costs(place(ADULT, pose), observed).values()))
    truth = float(cost(standing()))
    assert truth < 2
    root = np.zeros(3, np.float32)
    for seed in range(5):
        assert cost(Pose(root, np.asarray(pose_of(seed).rotations, np.float32))) > 20 * truth
