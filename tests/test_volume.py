"""A body with volume against a hull: distances, surface points, the terms built on them."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import ideal_graph, pose_of
from jax.test_util import check_grads
from scipy.spatial.transform import Rotation

from jaxskel import Pose, default_adult, default_solver, hull_volume, hulls_from_dense, make_grid, refine_frames
from jaxskel._body import make_body, place_body
from jaxskel._capsules import all_distances, capsule_distance
from jaxskel._skeleton import SEGMENT_NAMES, SEGMENT_PARENTS
from jaxskel.parametrisations import HingedLimbs
from jaxskel.terms import ArmCollision, HingeLimits, InsideHull, SurfaceCoverage, place, volume_objective

ADULT = jax.tree.map(lambda a: np.asarray(a, np.float32), default_adult())
BODY = jax.tree.map(lambda a: a if a.dtype == np.int32 else np.asarray(a, np.float32), make_body(default_adult()))
GRID = make_grid(np.array([-1.0, -1.0, -1.2]), np.array([1.0, 1.0, 1.0]), 0.02)


HINGED = HingedLimbs()
UNKNOWNS = 42


def standing() -> Pose:
    """At ease: knees and elbows a little bent, because dead straight is beyond what the limits allow."""
    flexions = np.zeros(UNKNOWNS, np.float32)
    flexions[[17, 23, 27, 31]] = 0.1  # see test_parametrisations
    rest = Pose(np.zeros(3, np.float32), np.tile(np.eye(3, dtype=np.float32), (17, 1, 1)))
    return jax.tree.map(np.asarray, HINGED.pose(jnp.asarray(flexions), rest, ADULT))


def turned(segment: str, axis: str, degrees: float) -> Pose:
    """Standing, with one segment and all that hangs on it turned about an axis."""
    turn = Rotation.from_euler(axis, degrees, degrees=True).as_matrix().astype(np.float32)
    carried, pose = [name == segment for name in SEGMENT_NAMES], standing()
    for number, parent in enumerate(SEGMENT_PARENTS[1:], 1):
        carried[number] |= carried[parent]
    return Pose(pose.root, np.where(np.array(carried)[:, None, None], turn @ pose.rotations, pose.rotations))


def hull_of(pose: Pose):
    """Voxels whose centres lie in the body."""
    ends, radii = place_body(make_body(default_adult()), jax.tree.map(lambda a: a[None], pose))
    centres = jnp.asarray(GRID.centres(), jnp.float32)
    distances = all_distances(centres, jnp.asarray(ends[0], jnp.float32), jnp.asarray(radii, jnp.float32))
    return hulls_from_dense(np.asarray(distances.min(1) < 0).reshape(1, *GRID.shape), GRID)


def observe(pose: Pose):
    field, surface = hull_volume(hull_of(pose), 0)
    return eqx.tree_at(
        lambda o: (o.field, o.surface), ideal_graph(ADULT, pose), (field, surface), is_leaf=lambda leaf: leaf is None
    )


@pytest.fixture(scope="module")
def observed():
    return observe(standing())


def test_distance_to_a_capsule_by_hand():
    ends = jnp.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    points = jnp.array([[3.0, 0.0, 1.0], [0.0, 0.0, 5.0], [0.0, 2.0, -1.0], [0.5, 0.0, 0.0]])
    radii = jnp.array([1.0, 2.0])  # 1.5 half-way
    expected = [1.5, 1.0, np.sqrt(5.0) - 1.0, -0.5]
    many = jnp.broadcast_to(ends, (4, 2, 3)), jnp.broadcast_to(radii, (4, 2))
    np.testing.assert_allclose(capsule_distance(points, *many), expected, atol=1e-4)
    np.testing.assert_allclose(all_distances(points, ends[None], radii[None])[:, 0], expected, atol=1e-4)


def test_both_distances_agree_far_from_the_origin():
    rng = np.random.default_rng(0)
    ends = jnp.asarray(rng.normal(size=(30, 2, 3)) + 20.0, jnp.float32)
    radii = jnp.asarray(rng.uniform(0.01, 0.1, (30, 2)), jnp.float32)
    points = jnp.asarray(rng.normal(size=(30, 3)) + 20.0, jnp.float32)
    np.testing.assert_allclose(
        jnp.diagonal(all_distances(points, ends, radii)), capsule_distance(points, ends, radii), atol=2e-4
    )


@pytest.mark.parametrize("spacing", [0.01, 0.02])
def test_field_of_a_ball(spacing):
    grid = make_grid(np.full(3, -0.7), np.full(3, 0.7), spacing)
    middle = np.array([0.05, -0.02, 0.11])
    ball = (np.linalg.norm(grid.centres() - middle, axis=1) < 0.4).reshape(1, *grid.shape)
    field, surface = hull_volume(hulls_from_dense(ball, grid), 0, count=500)
    assert surface.shape == (500, 3)
    assert np.abs(np.linalg.norm(surface - middle, axis=1) - 0.4).max() < spacing
    points = np.random.default_rng(1).normal(size=(400, 3))
    points *= (np.random.default_rng(2).uniform(0.15, 0.45, 400) / np.linalg.norm(points, axis=1))[:, None]
    distances = field.at(jnp.asarray(points + middle, jnp.float32))
    np.testing.assert_allclose(distances, np.linalg.norm(points, axis=1) - 0.4, atol=spacing)
    far = field.at(jnp.asarray([[9.0, 0.0, 0.0]], jnp.float32))
    assert far[0] > 0.05


def test_empty_hull_has_no_volume():
    empty = hulls_from_dense(np.zeros((1, *GRID.shape), bool), GRID)
    with pytest.raises(ValueError, match="frame 0 is empty"):
        hull_volume(empty, 0)


def norm(term, pose, observed) -> float:
    body = place(ADULT, pose)
    return float(jnp.linalg.norm(term.residual(body, observed, term.correspond(body, observed))))


# Term, bound of its residual at the truth (voxels are 20 mm), a pose that it must object to.
TERMS = {
    "coverage": (SurfaceCoverage(body=BODY, scale=1.0), 0.006, turned("l_upper_arm", "x", 40)),
    "inside": (InsideHull(body=BODY), 0.008, turned("l_upper_arm", "x", 40)),
    "collision": (ArmCollision(body=BODY), 0.001, turned("l_forearm", "x", -75)),
    "hinges": (HingeLimits(skeleton=ADULT), 1e-6, turned("l_shank", "y", -60)),
}


@pytest.mark.parametrize("name", TERMS)
def test_terms_are_content_with_the_truth_only(observed, name):
    term, bound, wrong = TERMS[name]
    assert norm(term, standing(), observed) < bound
    assert norm(term, wrong, observed) > 2 * bound


@pytest.mark.parametrize("name", TERMS)
def test_jacobians_of_terms_are_finite_differences(observed, name):
    term, _, base = TERMS[name]
    with jax.enable_x64(True):
        term, base, seen, skeleton = jax.tree.map(
            lambda a: jnp.asarray(a, jnp.float64) if np.asarray(a).dtype == np.float32 else a,
            (term, base, observed, ADULT),
        )
        fixed = term.correspond(place(skeleton, base), seen)

        @jax.jit
        def residual(unknowns):
            pose = HINGED.pose(jnp.asarray(unknowns), base, skeleton)
            return term.residual(place(skeleton, pose), seen, fixed)

        unknowns = 0.01 * jnp.asarray(np.random.default_rng(0).normal(size=UNKNOWNS))
        check_grads(residual, (unknowns,), order=1, modes=("fwd", "rev"), atol=1e-5, rtol=1e-5, eps=1e-7)
        assert jnp.abs(jax.jacfwd(residual)(unknowns)).max() > 1e-3


def test_knees_bend_to_the_back_and_not_to_the_front(observed):
    term = HingeLimits(skeleton=ADULT)
    assert norm(term, turned("l_shank", "y", 60), observed) < 0.1 < norm(term, turned("l_shank", "y", -60), observed)


# Perturbations that keep to what the objective asks for: each foot starts nearer to its own place than to the other's.
@pytest.mark.parametrize("seed", [1, 4, 5])
def test_volume_alone_recovers_a_pose(seed):
    truth = turned("l_upper_arm", "x", 40)
    observed = observe(truth)
    joints = np.asarray(place(ADULT, truth).joints)
    unknowns = 0.15 * jnp.asarray(np.random.default_rng(seed).normal(size=UNKNOWNS), jnp.float32)
    # What carries the feet far (position, pelvis, chest and thighs) by less than the rest.
    unknowns = unknowns.at[np.r_[0:9, 24:27, 28:31].astype(np.int32)].multiply(0.3)
    start = HINGED.pose(unknowns, jax.tree.map(jnp.asarray, truth), ADULT)
    started = np.asarray(place(ADULT, start).joints)
    for foot, other in ((11, 14), (14, 11)):
        assert np.linalg.norm(started[foot] - joints[foot]) < np.linalg.norm(started[foot] - joints[other])
    before = 1e3 * np.linalg.norm(started - joints, axis=1)
    one, seen = (jax.tree.map(lambda a: jnp.asarray(a)[None], tree) for tree in (start, observed))
    refined = refine_frames(volume_objective(BODY), HINGED, default_solver(), ADULT, one, seen, 8, 4)
    after = 1e3 * np.linalg.norm(np.asarray(refined.joints[0]) - joints, axis=1)
    assert refined.finite.all()
    assert np.median(before) > 40
    assert np.median(after) < 20
    assert after.max() < 60


def test_poses_of_random_limbs_cost_more_than_the_truth(observed):
    objective = volume_objective(BODY)

    def cost(pose):
        return float(sum(objective.costs(place(ADULT, pose), observed).values()))

    truth = cost(standing())
    assert all(cost(pose_of(seed)) > 2 * truth for seed in range(5))
