import pickle

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float
from support.phantoms import HandsTogether, ideal_graph, pose_of

from jaxskel.body import JOINT_PARENTS, default_adult, forward_kinematics
from jaxskel.refinement import Refined, refine_frames
from jaxskel.refinement.parametrisations import ExactBones
from jaxskel.refinement.solvers import NormalEquationsLM, default_solver
from jaxskel.refinement.terms import Objective, Observed, PlacedBody, paper_objective

ADULT = default_adult()
BONES = ExactBones()
UNKNOWNS = 31


def stacked(trees):
    return jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(leaf) for leaf in leaves]), *trees)


class Stick(HandsTogether):
    """Counts how often it is traced."""

    traces = 0

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, ""]:
        Stick.traces += 1
        return super().residual(body, observed, fixed)


def with_stick(weight) -> Objective:
    return Objective(paper_objective().terms | {"stick": Stick(weight=weight, length=0.25)})


# The same terms and options for most tests, because compiling takes seconds. A stick of this weight holds nothing.
PAPER = with_stick(1e-9)


def refined(initial, observed, objective=PAPER, rounds=12, max_steps=24) -> Refined:
    return refine_frames(objective, BONES, default_solver(), ADULT, initial, observed, rounds, max_steps)


TRUTHS = [pose_of(seed, 0.3) for seed in (20, 21, 22)]
retract = jax.jit(BONES.retract)
STARTS = [
    retract(0.1 * np.random.default_rng(i).normal(size=UNKNOWNS).astype(np.float32), truth, ADULT)
    for i, truth in enumerate(TRUTHS)
]
OBSERVED = stacked([ideal_graph(ADULT, truth) for truth in TRUTHS])


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
    # The graph determines nearly everything; the prior has little weight.
    objective = eqx.tree_at(lambda o: o.terms["rest"].weight, PAPER, jnp.asarray(1e-4))
    result = refined(start, OBSERVED, objective)
    assert result.finite.all()
    assert result.converged.all()
    assert errors(result).max() < 0.005
    joints = np.asarray(result.joints)
    lengths = np.linalg.norm(joints[:, 1:] - joints[:, list(JOINT_PARENTS[1:])], axis=-1)
    np.testing.assert_allclose(lengths, np.tile(ADULT.bone_lengths, (3, 1)), atol=5e-6)
    assert set(result.costs) == set(objective.terms)
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


def test_new_weights_and_data_do_not_compile_again():
    start = stacked(STARTS)
    before = refined(start, OBSERVED)
    traced = Stick.traces
    assert traced > 0
    moved = jax.tree.map(lambda a: a if a.dtype == bool else a + 0.01, OBSERVED)
    other = eqx.tree_at(lambda o: (o.terms["graph"].weight, o.terms["graph"].scale), with_stick(7.0), (45.0, 0.05))
    other = jax.tree.map(jnp.asarray, other)
    after = refined(jax.tree.map(jnp.array, start), moved, other)
    assert Stick.traces == traced
    assert np.abs(after.joints - before.joints).max() > 1e-3
    assert after.converged.all()


def test_too_few_steps_are_told():
    # A different objective, so that it is traced again; with one term, so that it compiles faster.
    traced = Stick.traces
    hasty = refined(stacked(STARTS), OBSERVED, Objective({"stick": Stick(weight=1e4)}), rounds=1, max_steps=1)
    assert Stick.traces > traced
    assert not hasty.converged.any()
    assert hasty.finite.all()


def test_a_custom_term_takes_part():
    start = stacked(STARTS)
    result = refined(start, OBSERVED, with_stick(1e4))
    apart = np.linalg.norm(result.joints[:, 5] - result.joints[:, 8], axis=-1)
    free = refined(start, OBSERVED)
    assert np.abs(np.linalg.norm(free.joints[:, 5] - free.joints[:, 8], axis=-1) - 0.25).min() > 0.05
    np.testing.assert_allclose(apart, 0.25, atol=0.02)
    assert set(result.costs) == {"graph", "end_nodes", "inner_nodes", "rest", "stick"}
    np.testing.assert_allclose(result.costs["stick"], 1e4 * (apart - 0.25) ** 2, rtol=1e-2, atol=1e-4)


def test_steps_are_those_of_optimistix():
    # The same damping, trust region and stop: only the linear algebra differs.
    def residuals(y, args):
        return {"valley": 10 * (y[1:] - y[:-1] ** 2), "floor": 1 - y[:-1]}

    start = jnp.array([-1.2, 1.0, 0.5])
    ours = optx.least_squares(residuals, NormalEquationsLM(rtol=1e-4, atol=1e-4), start, max_steps=64, throw=False)
    theirs = optx.least_squares(
        residuals, optx.LevenbergMarquardt(rtol=1e-4, atol=1e-4), start, max_steps=64, throw=False
    )
    assert ours.stats["num_steps"] == theirs.stats["num_steps"]
    np.testing.assert_allclose(ours.value, theirs.value, atol=1e-3)
    np.testing.assert_allclose(ours.value, 1.0, atol=1e-2)


def test_a_solve_ends_where_a_step_promises_too_little():
    def solved(ftol, edge=0.0):
        def residuals(y, _):
            return jnp.concatenate([y - 1, jnp.ones(1), jnp.where(y < edge, 1.0, 0.0)])

        solver = NormalEquationsLM(rtol=1e-9, atol=1e-9, ftol=ftol)
        solution = optx.least_squares(residuals, solver, jnp.array([1.1]), max_steps=64, throw=False)
        assert solution.result == optx.RESULTS.successful
        return float(solution.value[0]), int(solution.stats["num_steps"])

    # Damped by one, the first step goes half the way: from (0.1^2 + 1) / 2 to (0.05^2 + 1) / 2, by 0.74 % of the cost.
    last, steps = solved(0.0075)
    np.testing.assert_allclose(last, 1.05, atol=1e-6)
    assert steps == 1  # the equations are not formed again
    assert solved(0.0073)[0] < 1.03
    np.testing.assert_allclose(solved(0.0)[0], 1.0, atol=1e-6)
    # Where that step would raise the cost, it is not taken.
    np.testing.assert_allclose(solved(0.0075, edge=1.07)[0], 1.1, atol=1e-6)


def test_a_solver_that_meets_nan_says_so():
    solution = optx.least_squares(
        lambda y, args: y * jnp.nan, NormalEquationsLM(rtol=1e-4, atol=1e-4), jnp.ones(2), max_steps=8, throw=False
    )
    assert solution.result != optx.RESULTS.successful


def test_solvers_go_to_other_processes():
    assert pickle.loads(pickle.dumps(default_solver())) == default_solver()


def test_another_number_of_frames_compiles_nothing_and_changes_nothing():
    three = refined(stacked(STARTS), OBSERVED)
    traced = Stick.traces
    assert traced > 0
    for chosen in (np.arange(2), np.array([2, 1, 0, 0, 1, 2, 2])):
        some = jax.tree.map(lambda a, chosen=chosen: np.asarray(a)[chosen], (stacked(STARTS), OBSERVED))
        found = refined(*some)
        assert found.joints.shape == (len(chosen), 15, 3)
        # With JAX 0.8, another place in the stack rounds otherwise, by up to 0.04 mm after all steps.
        np.testing.assert_allclose(found.joints, np.asarray(three.joints)[chosen], atol=1e-4)
    assert Stick.traces == traced


def test_more_frames_than_fit_one_stack_are_refined_in_stacks():
    chosen = np.arange(40) % 3
    some = jax.tree.map(lambda a: np.asarray(a)[chosen], (stacked(STARTS), OBSERVED))
    found = refined(*some)
    np.testing.assert_allclose(found.joints, np.asarray(refined(stacked(STARTS), OBSERVED).joints)[chosen], atol=1e-4)
    assert found.converged.shape == (40,)
