"""Frames coupled in time: the band solver is the dense one, couplings smooth, gaps are bridged."""

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
import pytest
from support.optimisations import optimised
from support.phantoms import ideal_graph, pose_of

from jaxskel import default_adult, refine_frames, refine_sequence
from jaxskel.body import forward_kinematics
from jaxskel.refinement._sequence import _nearest_of
from jaxskel.refinement.parametrisations import ExactBones, SoftBones
from jaxskel.refinement.solvers import BandedEquations, default_solver, sequence_solver
from jaxskel.refinement.solvers._banded import solve_banded
from jaxskel.refinement.terms import (
    AbstractTerm,
    Objective,
    RestPrior,
    Smoothness,
    coupling_from_function,
    from_function,
)

ADULT = jax.tree.map(lambda a: np.asarray(a, np.float32), default_adult())
BONES = ExactBones()
FRAMES, FPS = 12, 30.0


@pytest.mark.parametrize("frames", [1, 2, 3, 6, 7])
def test_the_band_solver_is_the_dense_one(frames):
    rng, count = np.random.default_rng(frames), 4
    # Rows that see three frames each make a band that is positive definite.
    rows = np.zeros((5 * frames, frames, count))
    for frame in range(frames):
        rows[5 * frame : 5 * frame + 5, frame : frame + 3] = rng.normal(
            size=(5, len(rows[0, frame : frame + 3]), count)
        )
    flat = rows.reshape(len(rows), -1)
    dense = flat.T @ flat + 0.1 * np.eye(frames * count)
    blocks = dense.reshape(frames, count, frames, count).transpose(0, 2, 1, 3)
    gradient = rng.normal(size=(frames, count))

    def beside(distance):
        found = np.zeros((frames, count, count))
        for frame in range(frames - distance):
            found[frame] = blocks[frame, frame + distance]
        return jnp.asarray(found)

    with jax.enable_x64(True):
        equations = BandedEquations(beside(0), beside(1), beside(2), jnp.asarray(gradient))
        found = solve_banded(equations)
        change = rng.normal(size=(frames, count))
        np.testing.assert_allclose(np.ravel(equations.applied(jnp.asarray(change))), dense @ change.ravel(), rtol=1e-9)
    np.testing.assert_allclose(np.ravel(found), np.linalg.solve(dense, gradient.ravel()), rtol=1e-9, atol=1e-12)


retract, kinematics = jax.jit(BONES.retract), jax.jit(forward_kinematics)


def wave(frame: int):
    """A person who waves an arm: rotations change smoothly, the last joint fastest."""
    unknowns = np.zeros(31)
    unknowns[[0, 9 + 4, 9 + 6]] = 0.3 * np.sin(0.15 * frame + np.array([0.0, 1.0, 2.0]))
    return retract(jnp.asarray(unknowns, jnp.float32), pose_of(5, 0.2), ADULT)


POSES = [wave(frame) for frame in range(FRAMES)]
TRUTH = np.stack([np.concatenate(kinematics(ADULT, pose)) for pose in POSES])
INITIAL = jax.tree.map(lambda *a: jnp.stack([jnp.asarray(x, jnp.float32) for x in a]), *POSES)
GRAPHS = jax.tree.map(
    lambda *a: jnp.stack([jnp.asarray(x, jnp.float32) if x.dtype != bool else x for x in a]),
    *(ideal_graph(ADULT, pose) for pose in POSES),
)


def at_nodes(body, observed):
    """Tips where the paths end, pelvis and neck at their nodes."""
    return jnp.concatenate([body.tips - observed.paths[:, -1], body.joints[:2] - observed.inner])


def markers(noise: float, seed: int = 0):
    """Observations: tips, pelvis and neck, with noise (m)."""
    rng = np.random.default_rng(seed)
    ends = TRUTH[:, 15:] + rng.normal(0, noise, (FRAMES, 5, 3))
    two = TRUTH[:, :2] + rng.normal(0, noise, (FRAMES, 2, 3))
    paths = jnp.broadcast_to(jnp.asarray(ends, jnp.float32)[:, :, None], GRAPHS.paths.shape)
    return eqx.tree_at(lambda o: (o.paths, o.inner), GRAPHS, (paths, jnp.asarray(two, jnp.float32)))


SINGLE = Objective({"nodes": from_function(at_nodes, weight=100.0, needs_graph=True), "rest": RestPrior(weight=0.01)})


def smooth(weight: float) -> Objective:
    return SINGLE.plus(smooth=Smoothness(fps=FPS, weight=weight))


def refined(objective, observed, initial=INITIAL, solver=None):
    return refine_sequence(objective, BONES, solver or sequence_solver(), ADULT, initial, observed, 2, 16)


def points(result) -> np.ndarray:
    return np.concatenate([result.joints, result.tips], 1)


def roughness(result) -> float:
    return float(np.sqrt((np.diff(points(result), 2, axis=0) ** 2).sum(-1).mean()))


@pytest.mark.slow
def test_without_weight_frames_are_refined_as_if_alone():
    observed = markers(0.01)
    together = refined(smooth(1e-9), observed)
    alone = refine_frames(SINGLE, BONES, default_solver(), ADULT, INITIAL, observed, 2, 16)
    assert together.finite.all()
    np.testing.assert_allclose(points(together)[:, :2], points(alone)[:, :2], atol=2e-3)
    np.testing.assert_allclose(points(together)[:, 15:], points(alone)[:, 15:], atol=5e-3)


@pytest.mark.slow
def test_smoothness_takes_away_noise_and_costs_what_accelerates():
    observed = markers(0.02)
    rough, found = refined(smooth(1e-9), observed), refined(smooth(0.3), observed)
    assert found.converged.all()
    assert roughness(found) < 0.5 * roughness(rough)
    error = [np.linalg.norm(points(r)[:, [0, 1, *range(15, 20)]] - TRUTH[:, [0, 1, *range(15, 20)]], axis=-1).mean()
             for r in (rough, found)]  # fmt: skip
    assert error[1] < 0.8 * error[0]
    acceleration = np.diff(points(found), 2, axis=0) * FPS**2
    np.testing.assert_allclose(found.costs["smooth"][1:-1], 0.3 * (acceleration**2).sum((1, 2)) / 100, rtol=0.05)
    assert found.costs["smooth"][0] == found.costs["smooth"][-1] == 0


@pytest.mark.slow
def test_any_matrix_free_solver_comes_to_the_same_cost():
    observed = markers(0.02)
    free = optx.LevenbergMarquardt(1e-3, 1e-4, linear_solver=lx.Normal(lx.CG(1e-3, 1e-3, max_steps=5000)))
    by_band = refined(smooth(0.1), observed)
    with optimised():  # this solver runs for longer than it is compiled
        by_gradients = refined(smooth(0.1), observed, solver=free)
    results = by_band, by_gradients
    banded, other = ({name: float(cost.sum()) for name, cost in result.costs.items()} for result in results)
    for name in ("nodes", "smooth"):
        assert banded[name] > 1
        np.testing.assert_allclose(other[name], banded[name], rtol=0.02)


@pytest.mark.slow
def test_a_gap_is_bridged_and_told():
    observed = markers(0.0)
    gap = [4, 5, 6]
    broken = eqx.tree_at(lambda p: p.root, INITIAL, INITIAL.root.at[jnp.asarray(gap[:2])].set(jnp.nan))
    unseen = eqx.tree_at(lambda o: o.inner, observed, observed.inner.at[gap[2]].set(jnp.nan))
    result = refined(smooth(0.01), unseen, broken)
    np.testing.assert_array_equal(np.flatnonzero(~np.asarray(result.finite)), gap)
    assert np.isfinite(points(result)).all()
    # The other frames do not get worse, and the gap is filled better than by a constant pose.
    seen = np.setdiff1d(np.arange(FRAMES), gap)
    ends = [0, 1, *range(15, 20)]
    assert np.linalg.norm(points(result)[seen][:, ends] - TRUTH[seen][:, ends], axis=-1).max() < 0.02
    bridged, still = (np.linalg.norm(p - TRUTH[gap], axis=-1).mean() for p in (points(result)[gap], TRUTH[[3, 7, 7]]))
    assert bridged < 0.5 * still
    assert np.isnan(np.asarray(result.costs["nodes"])[gap[2]])


@pytest.mark.slow
def test_a_sequence_without_any_pose_gives_back_what_it_got():
    nothing = eqx.tree_at(lambda p: p.root, INITIAL, jnp.full_like(INITIAL.root, jnp.nan))
    result = refined(smooth(0.01), markers(0.0), nothing)
    assert not result.finite.any()
    assert not result.converged.any()
    np.testing.assert_array_equal(result.pose.rotations, INITIAL.rotations)


@pytest.mark.slow
def test_other_parametrisations_and_short_sequences_work_too():
    observed = markers(0.0)
    two, seen = jax.tree.map(lambda a: a[:2], INITIAL), jax.tree.map(lambda a: a[:2], observed)
    result = refine_sequence(smooth(0.1), SoftBones(), sequence_solver(), ADULT, two, seen, 2, 8)
    assert result.finite.all()
    assert np.linalg.norm(points(result) - TRUTH[:2], axis=-1).max() < 0.01
    assert "bone_lengths" in result.costs


ENDS = [0, 1, *range(15, 20)]  # what the markers determine
TRACED = []


class Counter(AbstractTerm):
    """Counts how often it is traced."""

    weight: float = 1.0
    needs_graph = False

    def residual(self, body, observed, fixed):
        TRACED.append(1)
        return 0.0 * body.joints[0]


@pytest.mark.slow
@pytest.mark.parametrize("bones", [BONES, SoftBones()], ids=["exact", "soft"])
def test_a_padded_sequence_is_refined_as_one_that_is_not(bones):
    objective = smooth(0.1).plus(count=Counter())

    def together(objective, initial, observed):
        return refine_sequence(objective, bones, sequence_solver(), ADULT, initial, observed, 1, 4)

    observed = markers(0.02)
    found = {}
    TRACED.clear()
    for count in (12, 9, 11):  # all are padded to 16
        found[count] = together(objective, *jax.tree.map(lambda a, count=count: a[:count], (INITIAL, observed)))
        assert found[count].joints.shape == (count, 15, 3)
        traced = len(TRACED) if count == 12 else traced
        assert len(TRACED) == traced > 0
    # What is compiled together with other code is not padded.
    alone = eqx.filter_jit(together)(objective, *jax.tree.map(lambda a: a[:9], (INITIAL, observed)))
    np.testing.assert_allclose(points(found[9]), points(alone), atol=2e-5)
    variances = [np.trace(each.covariance, axis1=2, axis2=3) for each in (found[9], alone)]
    np.testing.assert_allclose(*variances, rtol=0.05)
    for name, cost in alone.costs.items():
        np.testing.assert_allclose(found[9].costs[name], cost, rtol=1e-2, atol=1e-4)
    np.testing.assert_array_equal(found[9].steps, alone.steps)
    np.testing.assert_array_equal(found[9].converged, alone.converged)


@pytest.mark.slow
def test_no_coupling_crosses_a_gap():
    observed = markers(0.02)
    follows = np.arange(FRAMES) != 7
    solved = refine_sequence(smooth(0.1), BONES, sequence_solver(), ADULT, INITIAL, observed, 2, 16, follows)
    for place in (slice(7), slice(7, FRAMES)):
        part = jax.tree.map(lambda a, place=place: a[place], (INITIAL, observed))
        alone = refine_sequence(smooth(0.1), BONES, sequence_solver(), ADULT, *part, 2, 16)
        np.testing.assert_allclose(points(solved)[place][:, ENDS], points(alone)[:, ENDS], atol=1e-3)
    assert (np.asarray(solved.costs["smooth"])[[0, 6, 7, 11]] == 0).all()


@pytest.mark.slow
def test_a_coupling_without_derivative_at_equal_bodies_does_no_harm():
    def walked(before, body, after, speed):
        return jnp.linalg.norm(after.joints[0] - before.joints[0]) - speed

    objective = SINGLE.plus(walked=coupling_from_function(walked, 0.02))
    free = optx.LevenbergMarquardt(1e-3, 1e-4, linear_solver=lx.Normal(lx.CG(1e-3, 1e-3, max_steps=500)))
    given = jax.tree.map(lambda a: a[:7], (INITIAL, markers(0.01)))
    found = refine_sequence(objective, BONES, free, ADULT, *given, 1, 4)
    assert np.isfinite(points(found)).all()
    assert np.abs(points(found) - TRUTH[:7]).max() > 1e-4  # it has moved


def test_a_coupling_has_no_place_in_single_frames():
    with pytest.raises(ValueError, match="smooth: couples frames; use refine_sequence"):
        refine_frames(smooth(1.0), BONES, default_solver(), ADULT, INITIAL, GRAPHS)


@pytest.mark.parametrize(
    ("seen", "nearest"),
    [("1111", [0, 1, 2, 3]), ("0100", [1, 1, 1, 1]), ("1001", [0, 0, 3, 3]), ("10001", [0, 0, 0, 4, 4]),
     ("000", [0, 1, 2])],
)  # fmt: skip
def test_the_nearest_seen_frame(seen, nearest):
    np.testing.assert_array_equal(_nearest_of(jnp.asarray([c == "1" for c in seen])), nearest)
