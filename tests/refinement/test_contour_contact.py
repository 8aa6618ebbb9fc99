"""Contact of a body with outlines of silhouettes: the term by hand or summed up densely, and its quadrics."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads
from support.phantoms import ideal_graph, pose_of

from jaxskel import Pose, default_adult
from jaxskel.body import Body, capsule_ends, make_body, nearest_to_rays, rest_origins
from jaxskel.outlines import Contours
from jaxskel.refinement.parametrisations import HingedLimbs
from jaxskel.refinement.terms import ContourContact, Observed, place
from jaxskel.refinement.terms._quadrics import make_quadrics

pytestmark = pytest.mark.slow

ADULT = default_adult()
BODY = make_body(ADULT)
HINGED = HingedLimbs()
REST = Pose(np.zeros(3), np.tile(np.eye(3), (17, 1, 1)))
GRAPH = ideal_graph(ADULT, REST)


def looked_at(centres, directions) -> Observed:
    """Observations of a frame that consist of some rays only."""
    rays = Contours(jnp.asarray(centres), jnp.asarray(directions))
    return eqx.tree_at(lambda o: o.contours, GRAPH, rays, is_leaf=lambda leaf: leaf is None)


def doubled(tree):
    """All numbers in float64."""
    return jax.tree.map(lambda a: a if np.asarray(a).dtype.kind in "bi" else jnp.asarray(a, jnp.float64), tree)


@eqx.filter_jit
def _ends_of(body: Body, pose: Pose):
    placed = place(body.skeleton, pose)
    return capsule_ends(body, placed.origins, placed.rotations)


def ends_of(body: Body, pose: Pose) -> np.ndarray:
    return np.asarray(_ends_of(body, pose), np.float64)


# Without jit, each operation would be compiled separately.
placed_at = eqx.filter_jit(place)
correspond = eqx.filter_jit(ContourContact.correspond)
residual_of = eqx.filter_jit(ContourContact.residual)
cost_of = eqx.filter_jit(ContourContact.cost)


# A post of 0.1 m along z that moves with the pelvis, and rays along y beside it: 20 mm off it, 30 mm inside, 1 m away.
POST = Body(
    ADULT,
    np.zeros(2, np.int32),
    np.array([[0.0, 0, 0], [0, 0, 1]]) - np.asarray(rest_origins(ADULT))[[0, 0]],
    np.array([0.1, 0.1]),
    np.array([[0, 1]], np.int32),
)
BESIDE = looked_at([[0.12, -4.0, 0.5], [0.07, 3.0, 0.2], [-1.1, 2.0, 0.7]], np.tile([0.0, 1.0, 0.0], (3, 1)))


def test_cost_by_hand():
    at_rest = placed_at(ADULT, REST)
    cost = cost_of(ContourContact(body=POST), at_rest, BESIDE)
    np.testing.assert_allclose(cost, (0.02**2 + 0.3 * 0.03**2 + 0.06**2) / 3, rtol=2e-3)
    cost = cost_of(ContourContact(body=POST, inner=1.0, limit=0.025), at_rest, BESIDE)
    np.testing.assert_allclose(cost, (0.02**2 + 0.025**2 + 0.025**2) / 3, rtol=2e-3)


@pytest.mark.parametrize("shift", [0.0, 0.01, -0.02])
def test_residual_by_hand(shift):
    # Looked up at rest; then the post moves along x, towards the first two rays and away from the third.
    term = ContourContact(body=POST)
    fixed = correspond(term, placed_at(ADULT, REST), BESIDE)
    moved = Pose(np.array([shift, 0.0, 0.0]), REST.rotations)
    weight = np.array([1 / (1 + 0.4**2) ** 2, 0.3 / (1 + 0.6**2) ** 2, 1 / (1 + 20.0**2) ** 2]) / 3
    squares = (weight * (np.array([0.02, -0.03, 1.0]) + shift * np.array([-1, -1, 1])) ** 2).sum()
    residual = residual_of(term, placed_at(ADULT, moved), BESIDE, fixed)
    np.testing.assert_allclose((residual**2).sum(), squares + 2e-6 * shift**2, rtol=5e-3)


def test_moving_along_the_rays_costs_next_to_nothing():
    term = ContourContact(body=POST)
    fixed = correspond(term, placed_at(ADULT, REST), BESIDE)
    before, after = (
        (residual_of(term, placed_at(ADULT, Pose(np.array([0.0, y, 0.0]), REST.rotations)), BESIDE, fixed) ** 2).sum()
        for y in (0.0, 0.3)
    )
    np.testing.assert_allclose(after - before, 2e-6 * 0.3**2, atol=2e-8)


def test_quadrics_are_dense_sums():
    # Cases: no point on a capsule, one point, points at one end only, all points the same.
    with jax.enable_x64(True):
        rng = np.random.default_rng(0)
        ends = rng.normal(size=(5, 2, 3))
        which = np.concatenate([np.zeros(40, int), [1], np.full(10, 2), np.full(20, 3)])
        part, distance, weight = rng.uniform(size=71), rng.normal(size=71), rng.uniform(size=71)
        normal = rng.normal(size=(71, 3))
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        part[41:51] = 1.0
        normal[51:], part[51:] = normal[51], part[51]
        quadrics = make_quadrics(
            jnp.asarray(ends),
            jnp.asarray(which, jnp.int32),
            *(jnp.asarray(a) for a in (part, normal, distance, weight)),
        ).rows()
        for spread in (0.0, 0.1, 3.0):
            shift = spread * rng.normal(size=ends.shape)
            foot = (1 - part)[:, None] * shift[which, 0] + part[:, None] * shift[which, 1]
            dense = (weight * (distance - (normal * foot).sum(1)) ** 2).sum() + 1e-6 * (shift**2).sum()
            residual = quadrics.residual(jnp.asarray(ends + shift))
            assert residual.shape == (31,)
            np.testing.assert_allclose((residual**2).sum(), dense, rtol=1e-6)


@pytest.fixture(scope="module")
def scattered():
    """In float64: a term whose capsules have no taper, a pose, rays that pass near the body, correspondences."""
    with jax.enable_x64(True):
        rng = np.random.default_rng(0)
        base = doubled(pose_of(2, 0.3))
        body = eqx.tree_at(lambda b: b.radii, BODY, np.full(len(BODY.radii), 0.05))
        ends = ends_of(body, base)
        which, part = rng.integers(0, len(ends), 400), rng.uniform(size=(400, 1))
        near = (1 - part) * ends[which, 0] + part * ends[which, 1] + 0.06 * rng.normal(size=(400, 3))
        directions = rng.normal(size=(400, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        observed = doubled(looked_at(near - 4 * directions, directions))
        term, skeleton = doubled((ContourContact(body=body), ADULT))
        fixed = correspond(term, placed_at(skeleton, base), observed)
        return term, skeleton, base, observed, fixed


def test_squared_norm_is_the_weighted_mean_and_stays_so_to_first_order(scattered):
    term, skeleton, base, observed, fixed = scattered
    with jax.enable_x64(True):
        rays, radii = observed.contours, jnp.asarray(term.body.radii)[term.body.links]

        @jax.jit
        def distances(unknowns):
            placed = place(skeleton, HINGED.retract(unknowns, base, skeleton))
            ends = jnp.asarray(capsule_ends(term.body, placed.origins, placed.rotations))
            return nearest_to_rays(rays.centres, rays.directions, ends, radii).distance

        @jax.jit
        def summed(unknowns):
            residual = term.residual(place(skeleton, HINGED.retract(unknowns, base, skeleton)), observed, fixed)
            return (residual**2).sum()

        zeros = HINGED.unknowns(ADULT)
        there = distances(zeros)
        weight = jnp.where(there < 0, 0.3, 1.0) / (1 + (there / 0.05) ** 2) ** 2 / 400
        dense = lambda unknowns: float((weight * distances(unknowns) ** 2).sum())  # noqa: E731
        np.testing.assert_allclose(summed(zeros), dense(zeros), rtol=1e-6)
        assert dense(zeros) > 1e-5
        direction = jnp.asarray(np.random.default_rng(1).normal(size=len(zeros)))
        # Central differences, so that what is left of second order is small.
        step = 1e-5
        slopes = [(f(step * direction) - f(-step * direction)) / (2 * step) for f in (summed, dense)]
        assert abs(slopes[1]) > 1e-5
        np.testing.assert_allclose(slopes[0], slopes[1], rtol=1e-3)


def test_jacobian_is_finite_differences(scattered):
    term, skeleton, base, observed, fixed = scattered
    with jax.enable_x64(True):

        @jax.jit
        def residual(unknowns):
            # The finite differences come as NumPy arrays.
            pose = HINGED.retract(jnp.asarray(unknowns), base, skeleton)
            return term.residual(place(skeleton, pose), observed, fixed)

        unknowns = 0.05 * jnp.asarray(np.random.default_rng(0).normal(size=len(HINGED.unknowns(ADULT))))
        check_grads(residual, (unknowns,), order=1, modes=("fwd", "rev"), atol=1e-6, rtol=1e-6, eps=1e-5)
        assert jnp.abs(jax.jit(jax.jacfwd(residual))(unknowns)).max() > 0.01


def grazing(pose: Pose, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from around the body that touch it, by bisection on its balls: not by the package's own distances."""
    rng = np.random.default_rng(seed)
    ends, radii = ends_of(BODY, pose), np.asarray(BODY.radii)[BODY.links]
    share = np.linspace(0, 1, 33)[:, None]
    balls = (ends[:, None, 0] + share * (ends[:, 1] - ends[:, 0])[:, None]).reshape(-1, 3)
    radius = (radii[:, :1] + share[:, 0] * (radii[:, 1:] - radii[:, :1])).ravel()
    centres = rng.normal(size=(count, 3))
    centres = pose.root + 4 * centres / np.linalg.norm(centres, axis=1, keepdims=True)
    hit = ends[rng.integers(0, len(ends), count), 0] - centres  # through the middle of a ball
    across = np.cross(hit, rng.normal(size=(count, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    inside, outside = np.zeros(count), np.full(count, 2.5)  # m aside, where the body is no more
    for _ in range(16):
        middle = (inside + outside) / 2
        directions = hit + middle[:, None] * across
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        away = balls[None] - centres[:, None]
        squared = (away**2).sum(-1) - (away * directions[:, None]).sum(-1) ** 2
        touched = (squared < radius[None] ** 2).any(1)
        inside, outside = np.where(touched, middle, inside), np.where(touched, outside, middle)
    return centres, directions


@pytest.mark.parametrize("seed", [2, 5])
def test_tangent_rays_cost_nothing_at_the_truth_only(seed):
    truth, term = pose_of(seed, 0.3), ContourContact(body=BODY)
    observed = looked_at(*grazing(truth, 300, seed))

    def cost(pose: Pose) -> float:
        return float(cost_of(term, placed_at(ADULT, pose), observed))

    body = placed_at(ADULT, truth)
    residual = residual_of(term, body, observed, correspond(term, body, observed))
    # Tapered capsules are not measured exactly: some millimetres where one is seen nearly end on.
    assert np.sqrt(cost(truth)) < 0.003
    assert float(jnp.linalg.norm(residual)) < 0.003
    assert cost(Pose(truth.root + np.array([0.02, 0.01, 0.0]), truth.rotations)) > 5 * cost(truth)
    for other in range(10, 14):
        assert cost(pose_of(other, 0.3)) > 50 * cost(truth)


def test_lines_behind_the_camera_count_as_well():
    # A ray is a whole line: only its direction up to the sign matters.
    centres, directions = grazing(pose_of(2, 0.3), 20, 0)
    term, body = ContourContact(body=BODY), placed_at(ADULT, pose_of(3, 0.3))
    one, other = (cost_of(term, body, looked_at(centres, sign * directions)) for sign in (1, -1))
    np.testing.assert_allclose(one, other, rtol=1e-4)
    assert one > 0
