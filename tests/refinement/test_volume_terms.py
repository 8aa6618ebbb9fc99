"""The volume terms on cases that are computed by hand or written out densely."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.phantoms import drawn_body, ideal_graph, pose_of, shifted

from jaxskel import Pose, default_adult
from jaxskel.body import capsule_ends, make_body, rest_origins
from jaxskel.hull import DistanceField
from jaxskel.refinement.parametrisations import HingedLimbs
from jaxskel.refinement.terms import ArmCollision, InsideHull, SurfaceCoverage, place

ADULT = default_adult()
ORIGINS = np.asarray(rest_origins(ADULT))
HINGED = HingedLimbs()
REST = Pose(np.zeros(3), np.tile(np.eye(3), (17, 1, 1)))
AT_REST = place(ADULT, REST)
GRAPH = ideal_graph(ADULT, REST)


# Surface coverage


def dense(points, ends, moved, radii, scale=0.05, inner=0.3):
    """Weighted squared distances to tangent planes as a sum over points: look-up at `ends`, planes moved to `moved`."""
    along = ends[:, 1] - ends[:, 0]
    part = np.einsum("pck,ck->pc", points[:, None] - ends[None, :, 0], along) / (along**2).sum(-1)
    part = np.clip(part, 0, 1)
    away = points[:, None] - ends[None, :, 0] - part[..., None] * along[None]
    length = np.linalg.norm(away, axis=-1)
    signed = length - radii[:, 0] - part * (radii[:, 1] - radii[:, 0])
    rows, which = np.arange(len(points)), signed.argmin(1)
    part, normal, signed = part[rows, which][:, None], away[rows, which] / length[rows, which][:, None], signed.min(1)
    weight = np.where(signed < 0, inner, 1.0) / (1 + (signed / scale) ** 2) ** 2 / len(points)
    shift = moved[which] - ends[which]
    foot = (1 - part) * shift[:, 0] + part * shift[:, 1]
    return (weight * (signed - (normal * foot).sum(-1)) ** 2).sum()


@pytest.fixture(scope="module")
def covered():
    """In float64: term, skeleton, pose at which correspondences are looked up, observed, correspondences."""
    with jax.enable_x64(True):
        rng = np.random.default_rng(0)
        body = make_body(ADULT)
        truth, base = pose_of(2, 0.3), pose_of(2, 0.35)
        placed = place(ADULT, jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), truth))
        ends = np.asarray(capsule_ends(body, placed.origins, placed.rotations))
        # Points about the capsules, some inside, some so far that they hardly count.
        which, part = rng.integers(0, len(ends), 500), rng.uniform(size=(500, 1))
        directions = rng.normal(size=(500, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        radius = body.radii[body.links][which].mean(1, keepdims=True) * rng.uniform(0.6, 1.8, (500, 1))
        points = ends[which, 0] + part * (ends[which, 1] - ends[which, 0]) + radius * directions
        observed = eqx.tree_at(
            lambda o: o.surface, ideal_graph(ADULT, truth), jnp.asarray(points), is_leaf=lambda leaf: leaf is None
        )
        term, base, skeleton = jax.tree.map(
            lambda a: a if np.asarray(a).dtype == np.int32 else jnp.asarray(a, jnp.float64),
            (SurfaceCoverage(body=body), base, ADULT),
        )
        fixed = term.correspond(place(skeleton, base), observed)
        yield term, skeleton, base, observed, fixed


def ends_of(term, skeleton, base, unknowns):
    body = place(skeleton, HINGED.retract(unknowns, base, skeleton))
    return capsule_ends(term.body, body.origins, body.rotations)


def test_coverage_is_the_dense_sum_over_points(covered):
    term, skeleton, base, observed, fixed = covered
    with jax.enable_x64(True):
        zeros, rng = HINGED.unknowns(), np.random.default_rng(1)
        points, radii = np.asarray(observed.surface), np.asarray(term.body.radii)[term.body.links]
        start = np.asarray(ends_of(term, skeleton, base, zeros))
        for spread in (0.0, 0.02, 0.1):
            unknowns = jnp.asarray(spread * rng.normal(size=len(zeros)))
            moved = np.asarray(ends_of(term, skeleton, base, unknowns))
            residual = term.residual(place(skeleton, HINGED.retract(unknowns, base, skeleton)), observed, fixed)
            # What no point holds is held by a millionth of the squared displacement of the ends.
            held = 1e-6 * ((moved - start) ** 2).sum()
            expected = dense(points, start, moved, radii) + held
            assert expected > 1e-5
            np.testing.assert_allclose((residual**2).sum(), expected, rtol=1e-4)


def test_gradient_of_coverage_is_that_of_the_dense_sum(covered):
    term, skeleton, base, observed, fixed = covered
    with jax.enable_x64(True):
        zeros = HINGED.unknowns()
        points, radii = np.asarray(observed.surface), np.asarray(term.body.radii)[term.body.links]
        start = np.asarray(ends_of(term, skeleton, base, zeros))

        @jax.jit
        @jax.grad
        def gradient(unknowns):
            residual = term.residual(place(skeleton, HINGED.retract(unknowns, base, skeleton)), observed, fixed)
            return 0.5 * (residual**2).sum()

        # The dense sum is quadratic in the ends: central differences are its gradient up to rounding.
        by_ends = np.zeros_like(start)
        for index in np.ndindex(start.shape):
            step = np.zeros_like(start)
            step[index] = 1e-3
            ahead, behind = (dense(points, start, start + sign * step, radii) for sign in (1, -1))
            by_ends[index] = 0.5 * (ahead - behind) / 2e-3
        _, pull = jax.vjp(lambda unknowns: ends_of(term, skeleton, base, unknowns), zeros)
        expected = np.asarray(pull(jnp.asarray(by_ends))[0])
        assert np.abs(expected).max() > 1e-3
        np.testing.assert_allclose(gradient(zeros), expected, atol=1e-4 * np.abs(expected).max())


def test_cost_of_coverage_by_hand():
    # One capsule of 0.1 m along z; points 20 mm outside, 30 mm inside, 1 m away.
    body = drawn_body([("pelvis", (0, 0, 0), 0.1), ("pelvis", (0, 0, 1), 0.1)], [(0, 1)])
    points = jnp.array([[0.12, 0, 0.5], [0, 0.07, 0.2], [0, 0, 2.1]])
    observed = eqx.tree_at(lambda o: o.surface, GRAPH, points, is_leaf=lambda leaf: leaf is None)
    cost = SurfaceCoverage(body=body).cost(AT_REST, observed)
    np.testing.assert_allclose(cost, (0.02**2 + 0.3 * 0.03**2 + 0.06**2) / 3, rtol=1e-3)


# Inside the hull

# A hull that ends at the height of 0.65 m, and a capsule that sticks out of it.
HEIGHTS = np.broadcast_to(0.2 * np.arange(8) - 0.65, (8, 8, 8))
HALF_SPACE = DistanceField(HEIGHTS.astype(np.float32), np.zeros(3, np.float32), np.array(0.2, np.float32))
UPRIGHT = InsideHull(
    body=drawn_body([("pelvis", (0.7, 0.7, 0.3), 0.10), ("l_hand", (0.7, 0.7, 0.9), 0.16)], [(0, 1)]), scale=0.1
)


@pytest.mark.parametrize("raised", [0.0, 0.02, -0.03, -0.3])
def test_inside_hull_by_hand(raised):
    observed = eqx.tree_at(lambda o: o.field, GRAPH, HALF_SPACE, is_leaf=lambda leaf: leaf is None)
    # Heights 0.4, 0.6, 0.8 m, radii 0.11, 0.13, 0.15 m, of which 70 % must be below 0.65 m.
    out = np.array([0.4, 0.6, 0.8]) + 0.7 * np.array([0.11, 0.13, 0.15]) - 0.65
    np.testing.assert_allclose(out, [-0.173, 0.041, 0.255])
    weight = np.sqrt([1 / 3, 1 / (1 + 0.41**2) / 3, 1 / (1 + 2.55**2) / 3])
    fixed = UPRIGHT.correspond(AT_REST, observed)
    moved = shifted(AT_REST, pelvis=[0.05, 0, raised], l_hand=[0.05, 0, raised])
    residual = UPRIGHT.residual(moved, observed, fixed)
    np.testing.assert_allclose(residual, weight * np.maximum(out + raised, 0), atol=2e-6)
    expected = np.minimum(np.maximum(out + raised, 0), 0.1) ** 2
    np.testing.assert_allclose(UPRIGHT.cost(moved, observed), expected.mean(), atol=1e-6)


def test_inside_hull_places_its_points_along_the_axis():
    # The hand alone is raised by 0.06 m: a sixth, a half and five sixths of that.
    observed = eqx.tree_at(lambda o: o.field, GRAPH, HALF_SPACE, is_leaf=lambda leaf: leaf is None)
    fixed = UPRIGHT.correspond(AT_REST, observed)
    before, after = (UPRIGHT.residual(b, observed, fixed) for b in (AT_REST, shifted(AT_REST, l_hand=[0, 0, 0.06])))
    weight = np.sqrt([1 / (1 + 0.41**2) / 3, 1 / (1 + 2.55**2) / 3])
    np.testing.assert_allclose((after - before)[1:] / weight, [0.03, 0.05], atol=1e-5)


# Arm collision

# A post in the trunk, 0.1 m wide at its foot and 0.2 m at its top, and balls of an arm beside it.
ARM = ArmCollision(
    body=drawn_body(
        [
            ("pelvis", (0, 0, 0), 0.1), ("chest", (0, 0, 0.4), 0.2),
            ("l_forearm", (0.12, 0, 0.2), 0.05),  # 30 mm inside, of its radius 30 mm must be outside
            ("l_hand", (0.5, 0, 0), 0.04),  # far outside
            ("l_upper_arm", (0.05, 0, 0.1), 0.05), ("l_clavicle", (0, 0, 0.3), 0.05),  # deep inside, as they may
        ],
        [(0, 1), (4, 2), (2, 3), (5, 4)],
    )
)  # fmt: skip


@pytest.mark.parametrize(
    ("segments", "depth"),
    [
        ({}, 0.06),
        ({"l_forearm": [-0.01, 0, 0]}, 0.07),
        ({"pelvis": [-0.02, 0, 0], "chest": [-0.02, 0, 0]}, 0.04),
        ({"chest": [-0.02, 0, 0]}, 0.05),  # half-way up the post
        ({"l_forearm": [0, 0.03, 0.01]}, 0.06),  # along the tangent plane
        ({"l_forearm": [0.07, 0, 0]}, 0.0),
        ({"l_upper_arm": [0.02, 0, 0], "l_clavicle": [0.02, 0, 0]}, 0.06),
    ],
)
def test_arm_collision_by_hand(segments, depth):
    fixed = ARM.correspond(AT_REST, GRAPH)
    residual = ARM.residual(shifted(AT_REST, **segments), GRAPH, fixed)
    np.testing.assert_allclose(residual, [depth, 0], atol=1e-5)


def test_cost_of_arm_collision_by_hand():
    np.testing.assert_allclose(ARM.cost(AT_REST, GRAPH), 0.06**2, rtol=1e-3)
    np.testing.assert_allclose(eqx.tree_at(lambda t: t.limit, ARM, 0.05).cost(AT_REST, GRAPH), 0.05**2, rtol=1e-3)
    # Forearm and hand side by side: 60 mm and 24 + 20 mm deep.
    both = shifted(AT_REST, l_hand=[-0.42, 0, 0])
    np.testing.assert_allclose(ARM.cost(both, GRAPH), 0.06**2 + 0.044**2, rtol=1e-3)
    assert ARM.cost(shifted(AT_REST, l_forearm=[0.3, 0, 0]), GRAPH) == 0
