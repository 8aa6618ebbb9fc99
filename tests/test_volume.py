"""A body with volume against its silhouettes and its hull: the terms that are built on them, and their objective."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import ideal_graph, pose_of, ring
from scipy.spatial.transform import Rotation

from jaxskel import Pose, default_adult, hull_volume, hulls_from_dense, make_grid
from jaxskel._body import make_body, place_body
from jaxskel._capsules import nearest_capsule
from jaxskel._contours import contours
from jaxskel._descend import descend
from jaxskel._silhouette_distances import silhouette_distances
from jaxskel._skeleton import SEGMENT_NAMES, SEGMENT_PARENTS
from jaxskel.parametrisations import HingedLimbs
from jaxskel.synthetic import render
from jaxskel.terms import (
    ArmCollision,
    ContourContact,
    HingeLimits,
    InsideHull,
    InsideSilhouettes,
    Observed,
    SurfaceCoverage,
    place,
    volume_objective,
)

ADULT = jax.tree.map(lambda a: np.asarray(a, np.float32), default_adult())
BODY = jax.tree.map(lambda a: a if a.dtype == np.int32 else np.asarray(a, np.float32), make_body(default_adult()))
GRID = make_grid(np.array([-0.4, -0.8, -1.1]), np.array([0.4, 0.8, 1.0]), 0.02)
# Around the origin, where the pelvis is: a pixel is 11 mm wide there.
CAMERAS = ring(8, (320, 320), 360.0, height=-0.1)

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


def observe(pose: Pose) -> Observed:
    """What is seen of the body: silhouettes, and for a hull the voxels whose centres lie in it."""
    ends, radii = place_body(make_body(default_adult()), jax.tree.map(lambda a: a[None], pose))
    given = (jnp.asarray(a, jnp.float32) for a in (GRID.centres(), ends[0], radii))
    hulls = hulls_from_dense(np.asarray(jax.jit(nearest_capsule)(*given)[1] < 0).reshape(1, *GRID.shape), GRID)
    seen, lost = render(CAMERAS, ends, radii), np.zeros((1, len(CAMERAS)), bool)
    outlines, inside = (
        jax.tree.map(lambda a: a[0], each(seen, CAMERAS, lost)) for each in (contours, silhouette_distances)
    )
    graph = ideal_graph(ADULT, pose)
    return Observed(graph.paths, graph.found, graph.neck, graph.pelvis, *hull_volume(hulls, 0), outlines, inside)


@pytest.fixture(scope="module")
def observed():
    return observe(standing())


@eqx.filter_jit
def norm(term, pose, observed):
    body = place(ADULT, pose)
    return jnp.linalg.norm(term.residual(body, observed, term.correspond(body, observed)))


# Term, bound of its residual at the truth (voxels are 20 mm, pixels 11 mm), a pose that it must object to.
TERMS = {
    "contours": (ContourContact(body=BODY, scale=1.0), 0.005, turned("l_upper_arm", "x", 40)),
    "silhouettes": (InsideSilhouettes(body=BODY), 0.003, turned("l_upper_arm", "x", 40)),
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


def test_jacobians_of_terms_are_finite_differences(observed):
    # Contacts and hinges have tests of their own.
    terms = {name: TERMS[name][0] for name in ("silhouettes", "inside", "collision")}
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
                body = place(skeleton, HINGED.pose(unknowns, base, skeleton))
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


def test_silhouettes_alone_recover_poses_and_a_wrong_one_is_dear():
    truth = turned("l_upper_arm", "x", 40)
    joints = np.asarray(place(ADULT, truth).joints)
    unknowns = np.stack([0.15 * np.random.default_rng(seed).normal(size=UNKNOWNS) for seed in SEEDS])
    # What carries the feet far (position, pelvis, chest and thighs) by less than the rest.
    unknowns[:, np.r_[0:9, 24:27, 28:31]] *= 0.3
    start = jax.vmap(lambda u: HINGED.pose(u, jax.tree.map(jnp.asarray, truth), ADULT))(
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
    # It goes downhill only: a foot may be caught between both legs.
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
