import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads
from jaxtyping import Array, Float
from scipy.spatial.transform import Rotation

from jaxskel._limbs import END_NODE_REACH
from jaxskel._refine import Refined, default_solver, refine_frames
from jaxskel._skeleton import JOINT_NAMES, JOINT_PARENTS, TIP_PARENTS, Pose, default_adult, forward_kinematics
from jaxskel.parametrisations import ExactBones
from jaxskel.terms import (
    AbstractTerm,
    EndNodeAttraction,
    GraphAttraction,
    InnerNodeAttraction,
    Objective,
    Observed,
    PlacedBody,
    RestPrior,
    paper_objective,
    place,
)

ADULT = default_adult()
BONES = ExactBones()
UNKNOWNS = 31


def pose_of(seed, spread=0.5) -> Pose:
    """A standing person somewhere, segments turned at random by about `spread` (rad)."""
    rng = np.random.default_rng(seed)
    rotations = Rotation.from_rotvec(rng.normal(0, spread / np.sqrt(3), (13, 3))).as_matrix()
    return Pose(np.array([0.3, -0.2, 0.9]) + rng.normal(0, 0.1, 3), rotations)


def rigid_pose() -> Pose:
    turn = Rotation.from_euler("zx", (1.0, 0.2)).as_matrix()
    return Pose(np.array([0.3, -0.2, 0.9]), np.tile(turn, (13, 1, 1)))


# The joints on the way to each limb's end node; the head's own path is drawn from the neck.
TRUNK = ("head", "neck", "pelvis")
WAYS = (
    ("neck", "head"),
    (*TRUNK[:2], "l_shoulder", "l_elbow", "l_hand"),
    (*TRUNK[:2], "r_shoulder", "r_elbow", "r_hand"),
    (*TRUNK, "l_hip", "l_knee", "l_foot"),
    (*TRUNK, "r_hip", "r_knee", "r_foot"),
)


def ideal(pose: Pose) -> Observed:
    """The labelled graph of a body that is nothing but its bones: paths run through the joints to the end nodes."""
    joints, tips = (np.asarray(a, np.float64) for a in forward_kinematics(ADULT, pose))
    base = joints[list(TIP_PARENTS)]
    ends = base + END_NODE_REACH * (tips - base)
    paths = np.empty((5, 9, 3))
    for label, names in enumerate(WAYS):
        way = [*(ends[:1] if label else []), *(joints[JOINT_NAMES.index(name)] for name in names), ends[label]]
        paths[label] = way + way[-1:] * (9 - len(way))
    return Observed(*(jnp.asarray(a) for a in (paths, np.ones(5, bool), joints[1], joints[0])))


def stacked(trees):
    return jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *trees)


def refined(initial, observed, objective=None, **options) -> Refined:
    return refine_frames(objective or paper_objective(), BONES, default_solver(), ADULT, initial, observed, **options)


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


def test_no_two_unknowns_do_the_same():
    # Tilting the pelvis about its hips and twisting the chest move no joint, but what hangs on them is held to them.
    def body(unknowns):
        return jnp.concatenate([leaf.ravel() for leaf in jax.tree.leaves(place(ADULT, BONES.pose(unknowns, base, ADULT)))])

    base = jax.tree.map(jnp.asarray, pose_of(1))
    singular = np.linalg.svd(np.asarray(jax.jacfwd(body)(BONES.unknowns())), compute_uv=False)
    assert singular.shape == (UNKNOWNS,)
    assert singular.min() > 0.1


class HandsTogether(AbstractTerm):
    """A user's term: the hands hold a stick."""

    weight: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=1.0)
    length: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.4)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, ""]:
        return jnp.sqrt(((body.joints[5] - body.joints[8]) ** 2).sum() + 1e-12) - self.length


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
    observed = ideal(truth)

    def residual(pose):
        body = place(ADULT, pose)
        return term.residual(body, observed, term.correspond(body, observed))

    assert residual(truth).shape == shape
    np.testing.assert_allclose(residual(truth), 0.0, atol=2e-6)
    assert np.isfinite(residual(pose_of(7))).all()
    assert np.abs(residual(pose_of(7))).max() > 0.02


@pytest.mark.parametrize("name", TERMS)
def test_jacobians_of_terms_are_finite_differences(name):
    term, base, observed = TERMS[name][0], pose_of(4), ideal(pose_of(2))
    with jax.enable_x64(True):
        term, base, observed, skeleton = jax.tree.map(
            lambda a: a if a.dtype == bool else jnp.asarray(a, jnp.float64), (term, base, observed, ADULT)
        )
        fixed = term.correspond(place(skeleton, base), observed)

        def residual(unknowns):
            # The finite differences come as NumPy arrays.
            return term.residual(place(skeleton, BONES.pose(jnp.asarray(unknowns), base, skeleton)), observed, fixed)

        unknowns = 0.1 * jnp.asarray(np.random.default_rng(0).normal(size=UNKNOWNS))
        check_grads(residual, (unknowns,), order=1, modes=("fwd", "rev"), atol=1e-6, rtol=1e-6, eps=1e-5)
        assert jnp.abs(jax.jacfwd(residual)(unknowns)).max() > 0.1


def test_limbs_that_were_not_found_pull_at_nothing():
    observed = eqx.tree_at(lambda o: o.found, ideal(pose_of(2)), jnp.asarray([True, False, True, True, False]))
    body = place(ADULT, pose_of(4))
    ends = EndNodeAttraction().residual(body, observed, None)
    np.testing.assert_array_equal((np.asarray(ends) != 0).any(1), [True, False, True, True, False])
    moved = eqx.tree_at(lambda o: o.paths, observed, observed.paths.at[jnp.asarray([1, 4])].add(0.3))
    graph = GraphAttraction()
    for seen in (observed, moved):
        residual = graph.residual(body, seen, graph.correspond(body, seen))
        np.testing.assert_array_equal(residual, graph.residual(body, observed, graph.correspond(body, observed)))


def test_a_weight_multiplies_the_squared_norm():
    body, observed = place(ADULT, pose_of(4)), ideal(pose_of(2))
    costs = []
    for weight in (1.0, 9.0):
        objective = Objective({"ends": EndNodeAttraction(weight=weight)})
        costs.append((objective.residuals(body, observed, objective.correspond(body, observed))["ends"] ** 2).sum())
    np.testing.assert_allclose(costs[1], 9 * costs[0], rtol=1e-6)


DATA_TERMS = Objective(
    {
        "graph": GraphAttraction(weight=100.0),
        "ends": EndNodeAttraction(weight=400.0),
        "inner": InnerNodeAttraction(weight=100.0),
        "rest": RestPrior(weight=1e-4),  # decides what the graph leaves open
    }
)
TRUTHS = [pose_of(seed, 0.3) for seed in (20, 21, 22)]
STARTS = [
    BONES.pose(0.1 * jnp.asarray(np.random.default_rng(i).normal(size=UNKNOWNS)), truth, ADULT)
    for i, truth in enumerate(TRUTHS)
]
OBSERVED = stacked([ideal(truth) for truth in TRUTHS])


def errors(result: Refined) -> np.ndarray:
    """Distances of joints and tips from the truth (m), frames by points."""
    truth = np.stack([np.concatenate(forward_kinematics(ADULT, pose)) for pose in TRUTHS])
    return np.linalg.norm(np.concatenate([result.joints, result.tips], 1) - truth, axis=-1)


def test_refinement_recovers_a_perturbed_pose():
    start = stacked(STARTS)
    before = np.linalg.norm(
        np.stack([np.concatenate(forward_kinematics(ADULT, pose)) for pose in STARTS])
        - np.stack([np.concatenate(forward_kinematics(ADULT, pose)) for pose in TRUTHS]),
        axis=-1,
    )
    assert before.max(1).min() > 0.1
    result = refined(start, OBSERVED, DATA_TERMS, rounds=20, max_steps=24)
    assert result.finite.all()
    assert result.converged.all()
    assert errors(result).max() < 0.005
    joints = np.asarray(result.joints)
    lengths = np.linalg.norm(joints[:, 1:] - joints[:, list(JOINT_PARENTS[1:])], axis=-1)
    np.testing.assert_allclose(lengths, np.tile(ADULT.bone_lengths, (3, 1)), atol=5e-6)
    assert set(result.costs) == set(DATA_TERMS.terms)
    assert all(cost.shape == (3,) for cost in result.costs.values())


def test_a_broken_frame_fails_alone():
    start = stacked(STARTS)
    whole = refined(start, OBSERVED)
    no_start = eqx.tree_at(lambda p: p.root, start, start.root.at[1].set(jnp.nan))
    no_data = eqx.tree_at(lambda o: o.paths, OBSERVED, OBSERVED.paths.at[1, 3, 4].set(jnp.nan))
    for initial, observed in ((no_start, OBSERVED), (start, no_data)):
        result = refined(initial, observed)
        np.testing.assert_array_equal(result.finite, [True, False, True])
        assert not result.converged[1]
        for name in ("joints", "tips", "converged"):
            np.testing.assert_array_equal(getattr(result, name)[::2], getattr(whole, name)[::2])
        # The broken frame gives back what it started from.
        np.testing.assert_array_equal(result.pose.rotations[1], initial.rotations[1])
        np.testing.assert_array_equal(result.pose.root[1], initial.root[1])


def test_too_few_steps_are_told():
    start = stacked(STARTS)
    assert not refined(start, OBSERVED, rounds=1, max_steps=1).converged.any()
    result = refined(start, OBSERVED)
    assert result.converged.all()
    assert (result.steps >= 1).all()


class Counted(AbstractTerm):
    """Counts how often it is traced."""

    weight: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=1.0)
    traces = 0

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "3"]:
        Counted.traces += 1
        return body.joints[0] - observed.pelvis


def test_new_weights_and_data_do_not_compile_again():
    start = stacked(STARTS)

    def with_weights(counted, graph):
        return Objective({"counted": Counted(weight=counted), "graph": GraphAttraction(weight=graph, scale=graph / 900)})

    before = refined(start, OBSERVED, with_weights(100.0, 90.0))
    traced = Counted.traces
    assert traced > 0
    moved = jax.tree.map(lambda a: a if a.dtype == bool else a + 0.01, OBSERVED)
    after = refined(jax.tree.map(jnp.array, start), moved, with_weights(7.0, 45.0))
    assert Counted.traces == traced
    assert np.abs(after.joints - before.joints).max() > 1e-3
    # The counter does count: another number of frames is another shape.
    refined(jax.tree.map(lambda a: a[:2], start), jax.tree.map(lambda a: a[:2], OBSERVED), with_weights(7.0, 45.0))
    assert Counted.traces > traced


def test_a_custom_term_takes_part():
    start = stacked(STARTS)
    objective = Objective(paper_objective().terms | {"stick": HandsTogether(weight=1e4, length=0.25)})
    result = refined(start, OBSERVED, objective, rounds=6)
    apart = np.linalg.norm(result.joints[:, 5] - result.joints[:, 8], axis=-1)
    free = refined(start, OBSERVED, rounds=6)
    assert np.abs(np.linalg.norm(free.joints[:, 5] - free.joints[:, 8], axis=-1) - 0.25).min() > 0.05
    np.testing.assert_allclose(apart, 0.25, atol=0.02)
    assert set(result.costs) == {"graph", "end_nodes", "inner_nodes", "rest", "stick"}
    np.testing.assert_allclose(result.costs["stick"], 1e4 * (apart - 0.25) ** 2, rtol=1e-2, atol=1e-4)
