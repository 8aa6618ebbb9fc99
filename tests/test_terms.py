import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import HandsTogether, ideal_graph, pose_of
from jax.test_util import check_grads
from scipy.spatial.transform import Rotation

from jaxskel._skeleton import JOINT_PARENTS, TIP_PARENTS, Pose, default_adult, forward_kinematics
from jaxskel.parametrisations import ExactBones
from jaxskel.terms import EndNodeAttraction, GraphAttraction, InnerNodeAttraction, Objective, RestPrior, place

ADULT = default_adult()
BONES = ExactBones()
UNKNOWNS = 31


kinematics = jax.jit(forward_kinematics)
pose_from = jax.jit(BONES.pose)


def test_zero_unknowns_are_the_base_pose():
    base = pose_of(0)
    assert BONES.unknowns().shape == (UNKNOWNS,)
    np.testing.assert_array_equal(BONES.unknowns(), 0.0)
    pose = pose_from(BONES.unknowns(), base, ADULT)
    np.testing.assert_allclose(pose.root, base.root, atol=1e-6)
    np.testing.assert_allclose(pose.rotations, base.rotations, atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_bones_are_exact_for_any_unknowns(seed):
    unknowns = jnp.asarray(np.random.default_rng(seed).normal(0, 2.0, UNKNOWNS))
    pose = pose_from(unknowns, pose_of(seed, 2.0), ADULT)
    gram = np.einsum("sij,sik->sjk", pose.rotations, pose.rotations)
    np.testing.assert_allclose(gram, np.tile(np.eye(3), (13, 1, 1)), atol=2e-6)
    joints, tips = (np.asarray(a) for a in kinematics(ADULT, pose))
    lengths = np.linalg.norm(joints[1:] - joints[list(JOINT_PARENTS[1:])], axis=1)
    np.testing.assert_allclose(lengths, ADULT.bone_lengths, atol=2e-6)
    np.testing.assert_allclose(np.linalg.norm(tips - joints[list(TIP_PARENTS)], axis=1), ADULT.tip_lengths, atol=2e-6)


def test_each_unknown_turns_its_bone_by_as_many_radians():
    base = pose_of(3)

    def directions(unknowns):
        joints = np.asarray(kinematics(ADULT, pose_from(jnp.asarray(unknowns), base, ADULT))[0])
        bones = joints[1:] - joints[list(JOINT_PARENTS[1:])]
        return bones / np.linalg.norm(bones, axis=1, keepdims=True)

    rest, turned = directions(np.zeros(UNKNOWNS)), []
    for unknown in range(9, UNKNOWNS):  # after position, pelvis and chest
        angles = np.arccos(np.clip((directions(0.3 * (np.arange(UNKNOWNS) == unknown)) * rest).sum(1), -1, 1))
        turned.append(int(angles.argmax()))
        np.testing.assert_allclose(angles[turned[-1]], 0.3, atol=1e-3)
        np.testing.assert_allclose(np.delete(angles, turned[-1]), 0.0, atol=1e-3)
    assert turned[::2] == turned[1::2] == sorted(set(turned))  # two for each bone


def test_no_two_unknowns_do_the_same():
    # Tilting the pelvis about its hips and twisting the chest move no joint, but what hangs on them is held to them.
    def body(unknowns):
        return jnp.concatenate(
            [leaf.ravel() for leaf in jax.tree.leaves(place(ADULT, BONES.pose(unknowns, base, ADULT)))]
        )

    base = jax.tree.map(jnp.asarray, pose_of(1))
    singular = np.linalg.svd(np.asarray(jax.jacfwd(body)(BONES.unknowns())), compute_uv=False)
    assert singular.shape == (UNKNOWNS,)
    assert singular.min() > 0.1


def rigid_pose() -> Pose:
    turn = Rotation.from_euler("zx", (1.0, 0.2)).as_matrix()
    return Pose(np.array([0.3, -0.2, 0.9]), np.tile(turn, (13, 1, 1)))


def held_stick() -> float:
    joints, _ = forward_kinematics(ADULT, pose_of(2))
    return float(np.linalg.norm(joints[5] - joints[8]))


# Term, a pose at which it is satisfied, shape of its residual.
TERMS = {
    "graph": (GraphAttraction(), pose_of(2), (10, 5, 3)),
    "end nodes": (EndNodeAttraction(), pose_of(2), (5, 3)),
    "inner nodes": (InnerNodeAttraction(), pose_of(2), (2, 3)),
    "rest": (RestPrior(), rigid_pose(), (12, 3, 3)),
    "custom": (HandsTogether(length=held_stick()), pose_of(2), ()),
}


@pytest.mark.parametrize("name", TERMS)
def test_terms_vanish_at_the_truth_only(name):
    term, truth, shape = TERMS[name]
    observed = ideal_graph(ADULT, truth)

    def residual(pose):
        body = place(ADULT, pose)
        return term.residual(body, observed, term.correspond(body, observed))

    assert residual(truth).shape == shape
    np.testing.assert_allclose(residual(truth), 0.0, atol=2e-6)
    assert np.isfinite(residual(pose_of(7))).all()
    assert np.abs(residual(pose_of(7))).max() > 0.02


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
            return term.residual(place(skeleton, BONES.pose(jnp.asarray(unknowns), base, skeleton)), observed, fixed)

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


def test_a_weight_multiplies_the_squared_norm():
    body, observed = place(ADULT, pose_of(4)), ideal_graph(ADULT, pose_of(2))
    costs = []
    for weight in (1.0, 9.0):
        objective = Objective({"ends": EndNodeAttraction(weight=weight)})
        costs.append((objective.residuals(body, observed, objective.correspond(body, observed))["ends"] ** 2).sum())
    np.testing.assert_allclose(costs[1], 9 * costs[0], rtol=1e-6)
