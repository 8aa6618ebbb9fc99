"""The search for poses, on silhouettes of a body that is known."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.capsule_films import ADULT, BODY, Filmed, film_body, joints_of, some

from jaxskel import Pose
from jaxskel._runtime.batching import on_device, single_precision
from jaxskel.body import JOINT_NAMES, SEGMENT_NAMES
from jaxskel.refinement.parametrisations import HingedLimbs
from jaxskel.refinement.terms import Observed, place, volume_objective
from jaxskel.search import (
    Hypotheses,
    Search,
    fit_of,
    fit_pool,
    fit_scales,
    make_model,
    pool_of,
    solve_frames,
    turned_rivals,
)
from jaxskel.search._gauss_newton import descend
from jaxskel.search._limb_search import with_limb
from jaxskel.search._search import ARMS, BOTH, with_limbs
from jaxskel.synthetic import demo_motion

THIN = eqx.tree_at(lambda b: b.radii, BODY, 0.85 * BODY.radii)
# Some frames cost much and others do not, so that legs are searched for in some of them.
SEARCH = Search(doubtful=4.5)
# Of the demo motion at 5 frames a second: two of a walk, waving, a turn, crane stand, crouch, twice hands on hips.
FRAMES = [7, 9, 18, 35, 43, 50, 55, 57]
ON_HIPS = slice(6, 8)


def farthest(joints: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Errors of the joints of each frame (m)."""
    return np.linalg.norm(joints - other, axis=-1).max(-1)


def _fitted(poses: Pose, observed: Observed, *rounds: tuple[float, int]) -> Hypotheses:
    """Hypotheses with axes ``frames hypotheses``, fitted in rounds (scales in metres, and steps)."""
    frames, count = np.arange(len(poses.root)), poses.root.shape[1]
    found = fit_pool(*fit_of(BODY), pool_of(poses, frames), on_device(observed), fit_scales(*rounds))
    return found.rows(frames, count)


@pytest.fixture(scope="module")
def filmed() -> Filmed:
    return film_body(some(demo_motion(ADULT), FRAMES), 5.0)


@pytest.fixture(scope="module")
def found(filmed) -> Hypotheses:
    return solve_frames(make_model(BODY), SEARCH, filmed.starts, filmed.fallback, filmed.observed)


# The search


def test_search_finds_every_joint(filmed, found):
    joints = joints_of(some(found.poses, (slice(None), 0)))
    assert farthest(joints, filmed.joints).max() < 0.1
    assert np.median(np.linalg.norm(joints - filmed.joints, axis=-1)) < 0.015
    # No start had its arms there.
    before = min(
        farthest(joints_of(some(filmed.starts, (slice(None), i))), filmed.joints)[ON_HIPS].min() for i in range(8)
    )
    assert before > 0.2


def test_hypotheses_are_ordered_by_what_they_cost(filmed, found):
    model = make_model(BODY)
    assert found.cost.shape == found.poses.root.shape[:2] == (8, SEARCH.trunks * SEARCH.pairs)
    # Where fewer differ, the last one is repeated at infinite cost.
    assert np.isfinite(found.cost[:, :2]).all()
    assert (found.cost[:, 1:] >= found.cost[:, :-1]).all()
    assert (found.cost[:, 0] < found.cost[:, -1]).all()

    @jax.jit
    @jax.vmap
    def costs(pose, observed):
        return sum(model.objective.costs(place(model.skeleton, pose), observed).values())

    for hypothesis in (0, 5):
        poses = jax.tree.map(jnp.asarray, some(found.poses, (slice(None), hypothesis)))
        there = np.isfinite(found.cost[:, hypothesis])
        expected = found.cost[there, hypothesis]
        np.testing.assert_allclose(costs(poses, filmed.observed)[there], expected, rtol=1e-3)


def test_what_is_found_is_a_pose_of_the_skeleton(found):
    turned = np.asarray(found.poses.rotations)
    np.testing.assert_allclose(turned @ turned.swapaxes(-1, -2), np.broadcast_to(np.eye(3), turned.shape), atol=1e-4)
    np.testing.assert_allclose(np.linalg.det(turned), 1.0, atol=1e-4)


def test_frames_do_not_depend_on_the_others_of_their_chunk(filmed, found):
    # Costly and cheap ones, in another order; the last one is repeated to fill the chunk.
    chosen = [5, 1, 6]
    alone = solve_frames(make_model(BODY), SEARCH, *some((filmed.starts, filmed.fallback, filmed.observed), chosen))
    assert alone.cost.shape == (3, found.cost.shape[1])
    np.testing.assert_allclose(alone.cost[:, 0], found.cost[chosen, 0], rtol=1e-3)
    joints, expected = (joints_of(some(h.poses, (slice(None), 0))) for h in (alone, found))
    assert farthest(joints, expected[chosen]).max() < 1e-3


def test_the_fallback_is_used_where_starts_fail(filmed):
    # Start poses 2 m away from the person; frames in which the person stands on both feet.
    standing = [2, 3, 6, 7]
    starts, fallback, observed = some((filmed.starts, filmed.fallback, filmed.observed), standing)
    away = Pose(starts.root + np.array([2.0, 0.0, 0.0]), starts.rotations)
    found = solve_frames(make_model(BODY), SEARCH, away, fallback, observed)
    joints = joints_of(some(found.poses, (slice(None), 0)))
    assert farthest(joints, filmed.joints[standing]).max() < 0.1


def test_arms_are_searched_for_again_only_where_a_pose_costs_more_than_enough(filmed, found):
    def costs(enough: float) -> np.ndarray:
        search = replace(SEARCH, enough=enough)
        return solve_frames(make_model(BODY), search, filmed.starts, filmed.fallback, filmed.observed).cost[:, 0]

    never = costs(np.inf)
    enough = float(np.median(never))  # so that half of the frames are searched further
    some_of_them, always = costs(enough), found.cost[:, 0]
    cheap = never <= enough
    np.testing.assert_allclose(some_of_them[cheap], never[cheap], rtol=1e-3)
    np.testing.assert_allclose(some_of_them[~cheap], always[~cheap], rtol=1e-3)
    assert (always < never).any()
    assert (always <= never * 1.001).all()


@pytest.mark.slow
@pytest.mark.parametrize("names", [("l_arm", "r_arm"), ("l_leg", "r_leg"), ("r_arm",)])
def test_limbs_that_are_freed_are_found_again(filmed, names):
    # This does not depend on where the limbs were: here all are as in the table's first row.
    model = make_model(BODY)
    wrong = jax.tree.map(lambda a: jnp.asarray(a, jnp.float32), filmed.truth)
    for name in names:
        wrong = jax.vmap(lambda pose, limb=model.limbs[name]: with_limb(pose, limb, jnp.asarray(0)))(wrong)
    pair, which = (names, BOTH) if len(names) == 2 else (ARMS, np.full(2, ARMS.index(names[0]), np.int32))
    found = with_limbs(model, wrong, jnp.arange(8), on_device(filmed.observed), pair, which, 4)
    ends = {"arm": ("elbow", "hand"), "leg": ("knee", "foot")}
    at = [JOINT_NAMES.index(f"{name[:2]}{end}") for name in names for end in ends[name[2:]]]
    off = [farthest(joints_of(some(found, np.s_[:, i]))[:, at], filmed.joints[:, at]) for i in range(4)]
    # Rows of the table are 15 degrees apart; limbs that hide each other may be told apart by the fit only.
    assert np.median(np.min(off, 0)) < 0.15
    assert np.min(off, 0).max() < 0.25
    assert farthest(joints_of(wrong)[:, at], filmed.joints[:, at]).min() > 0.3


# Fitting


@pytest.mark.slow
def test_without_arms_no_outline_tells_where_they_are(filmed):
    """The first steps of a search do without arms: wherever these are, they touch nothing."""
    model = make_model(BODY)
    truth, seen = (some(single_precision(tree), 1) for tree in (filmed.truth, filmed.observed))
    arms = np.array([name[2:] in ("upper_arm", "forearm", "hand") for name in SEGMENT_NAMES])
    elsewhere = Pose(truth.root, np.where(arms[:, None, None], np.eye(3, dtype=np.float32), truth.rotations))
    with_arms, without, moved = (
        {name: float(cost) for name, cost in volume_objective(body).costs(place(BODY.skeleton, pose), seen).items()}
        for body, pose in ((model.body, truth), (model.armless, truth), (model.armless, elsewhere))
    )
    for name in ("contours", "inside", "collision"):
        assert moved[name] == pytest.approx(without[name], rel=1e-5)
    assert without["contours"] > 2 * with_arms["contours"]


def test_without_steps_poses_are_only_ordered(filmed):
    # Seven hypotheses of nine frames: neither fills its chunks.
    frames, rng = np.array([0, 1, 2, 3, 4, 5, 6, 7, 0]), np.random.default_rng(0)
    off = rng.permuted(np.tile(0.01 * np.arange(7), (9, 1)), axis=1)
    truth = some(filmed.truth, frames)
    roots = truth.root[:, None] + off[..., None] * [0.6, 0.0, 0.8]
    poses = Pose(roots, np.repeat(truth.rotations[:, None], 7, 1))
    found = _fitted(poses, some(filmed.observed, frames), (0.04, 0))
    assert found.cost.shape == (9, 7)
    expected = np.take_along_axis(roots, np.argsort(off, 1)[..., None], 1)
    np.testing.assert_allclose(found.poses.root, expected, atol=1e-6)
    np.testing.assert_allclose(found.poses.rotations, poses.rotations, atol=1e-6)
    np.testing.assert_allclose(found.cost[8], found.cost[0], rtol=1e-5)


def test_fits_come_back_to_the_truth(filmed):
    off = Pose(filmed.truth.root + [0.03, -0.02, 0.02], filmed.truth.rotations)
    found = _fitted(some(off, np.s_[:, None]), filmed.observed, (0.06, 4), (0.04, 4))
    joints = joints_of(some(found.poses, (slice(None), 0)))
    assert farthest(joints, filmed.joints).max() < 0.05
    assert np.median(np.linalg.norm(joints - filmed.joints, axis=-1)) < 0.012


def test_scales_by_hand():
    scales, steps = fit_scales((0.08, 3), (0.05, 2))
    assert int(steps) == 5
    np.testing.assert_allclose(scales[:5], [0.08, 0.08, 0.08, 0.05, 0.05])
    # Of the same shape whatever the steps, so that nothing compiles again.
    assert scales.shape == fit_scales((0.04, 9))[0].shape


@pytest.mark.slow
def test_a_step_of_descent_lowers_what_it_linearised(filmed):
    model, hinged = make_model(BODY), HingedLimbs()
    observed, rng = some(filmed.observed, 1), np.random.default_rng(0)
    truth = jax.tree.map(lambda a: jnp.asarray(a, jnp.float32), some(filmed.truth, 1))

    @jax.jit
    def step(unknowns):
        base = hinged.retract(unknowns, truth, model.skeleton)
        fixed = model.objective.correspond(place(model.skeleton, base), observed)

        def cost(pose):
            residuals = model.objective.residuals(place(model.skeleton, pose), observed, fixed)
            return sum((r**2).sum() for r in residuals.values())

        after = descend(model.objective, hinged, model.skeleton, base, observed)
        return cost(base), cost(after), after.rotations

    for spread in (0.02, 0.05, 0.1, 0.2):
        before, after, turned = step(jnp.asarray(spread * rng.normal(size=len(hinged.unknowns(ADULT))), jnp.float32))
        # Most of the cost of a wrong pose can be removed.
        assert float(after) < (0.9 if spread < 0.05 else 0.7) * float(before)
        np.testing.assert_allclose(turned @ turned.swapaxes(1, 2), np.tile(np.eye(3), (17, 1, 1)), atol=1e-5)


def test_where_costs_tell_little_each_frame_has_a_pose_that_faces_the_other_way(filmed, found):
    chosen = [0, 3]
    search = SEARCH.relative_to(4.0, 60.0)
    assert search.looks_both_ways
    both = solve_frames(make_model(BODY), search, *some((filmed.starts, filmed.fallback, filmed.observed), chosen))
    assert turned_rivals(both).any(1).all()
    assert (both.cost[:, 0] <= found.cost[chosen, 0] + 1e-3).all()


def test_a_search_looks_both_ways_only_where_poses_typically_cost_much():
    search = Search(vague=30.0)
    vague = search.relative_to(20.0, 31.0)
    assert vague.looks_both_ways
    assert vague.enough_cost == 0.0
    usual = search.relative_to(20.0, 29.0)
    assert (usual.vague, usual.doubtful) == (30.0, 30.0)
    assert 29.0 < usual.enough_cost < 34.0
    assert not vague.without_rivals().looks_both_ways


def test_costs_that_are_given_stay_whatever_poses_of_the_subject_cost():
    assert (Search().enough_cost, Search().doubtful_cost) == (0.0, 45.0)
    for typical in (5.0, 60.0):
        found = Search(enough=0.0, doubtful=np.inf).relative_to(4.0, typical)
        assert (found.enough_cost, found.doubtful_cost) == (0.0, np.inf)
    found = Search(enough=7.0).relative_to(4.0, 5.0)
    assert (found.enough, found.doubtful) == (7.0, 14.0)
    with pytest.raises(ValueError, match="enough: is -1.0; give a cost, or None"):
        Search(enough=-1.0)
