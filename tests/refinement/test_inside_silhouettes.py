"""The term for a body inside the silhouettes: which view decides, the cost, and dense sums against its quadrics."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.phantoms import chain, drawn_body, film, ideal_graph, pose_of, ring, shifted

from jaxskel import Pose, default_adult, make_body, make_cameras
from jaxskel.body import capsule_ends
from jaxskel.outlines import SilhouetteDistances, silhouette_distances
from jaxskel.refinement.parametrisations import HingedLimbs
from jaxskel.refinement.terms import InsideSilhouettes, Observed, place

ADULT = default_adult()
HINGED = HingedLimbs()
AT_REST = place(ADULT, Pose(np.zeros(3), np.tile(np.eye(3), (17, 1, 1))))
GRAPH = ideal_graph(ADULT, Pose(np.zeros(3), np.tile(np.eye(3), (17, 1, 1))))
WHERE = np.array([1 / 6, 1 / 2, 5 / 6])  # along each capsule


def observed(silhouettes: SilhouetteDistances) -> Observed:
    return eqx.tree_at(lambda o: o.silhouettes, GRAPH, silhouettes, is_leaf=lambda leaf: leaf is None)


def sloping(offsets: list[float], slopes: list[float], misses: int = 0) -> Observed:
    """Views from the origin along z whose distance (m) is offset * z / 2 + slope * x: linear in the point.

    The image ends where abs(x) = z / 2.
    """
    count = len(offsets)
    K = np.array([[100.0, 0.0, 50.0], [0.0, 100.0, 50.0], [0.0, 0.0, 1.0]])
    cameras = make_cameras(
        np.tile(K, (count, 1, 1)), np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)), (101, 101)
    )
    pixels = np.arange(101) - 50.0
    rows = 50 * np.array(offsets)[:, None] + np.array(slopes)[:, None] * pixels
    values = np.tile(rows, 101).astype(np.float32)
    shape, step = np.array([101, 101], np.int32), np.array(1, np.float32)
    return observed(SilhouetteDistances(values, shape, step, cameras, np.array(misses, np.int32)))


@eqx.filter_jit
def costs(term: InsideSilhouettes, points: jax.Array, radii: jax.Array, seen: Observed) -> jax.Array:
    assert seen.silhouettes is not None
    return term.costs(seen.silhouettes.at(points), radii, jnp.asarray(seen.silhouettes.misses))


@eqx.filter_jit
def distances(seen: Observed, points: jax.Array) -> jax.Array:
    assert seen.silhouettes is not None
    return seen.silhouettes.at(points)


# Two metres in front of the views: thin along x from -0.3 to 0.3 m, and a thicker one across.
POST = InsideSilhouettes(
    body=drawn_body(
        [("pelvis", (-0.3, 0, 2), 0.02), ("l_hand", (0.3, 0, 2), 0.02), ("r_hand", (0.1, 0.3, 2.2), 0.06)],
        [(0, 1), (1, 2)],
    )
)


# What a point costs


@pytest.mark.parametrize(("misses", "decides"), [(0, 0.06), (1, 0.034), (2, 0.004), (3, 0.0)])
def test_the_view_that_objects_most_after_those_that_may_err_decides(misses, decides):
    # 20, -10, 50 and -80 mm, and 70 % of a radius of 20 mm; what exceeds 60 mm, or 30 mm in single views, is cut.
    seen = sloping([0.02, -0.01, 0.05, -0.08], [0.0] * 4, misses)
    cost = costs(POST, jnp.array([[0.0, 0.0, 2.0]]), jnp.array([0.02]), seen)
    singles = 0.03**2 + 0.004**2 + 0.03**2
    np.testing.assert_allclose(cost, [decides**2 + 0.3 * singles], rtol=1e-3)


def test_each_point_has_a_view_of_its_own_that_decides():
    # Left of the middle the second view objects, right of it the first: 40 mm each at 0.2 m.
    points = jnp.array([[-0.2, 0.0, 2.0], [0.2, 0.0, 2.0], [0.0, 0.0, 2.0]])
    radii = jnp.zeros(3)
    opposite = [0.2, -0.2]
    expected = 0.04**2 + 0.3 * 0.03**2
    np.testing.assert_allclose(
        costs(POST, points, radii, sloping([0.0, 0.0], opposite)), [expected, expected, 0.0], atol=1e-7
    )
    # One view may err, and the other one has no depth; the first still counts with the weight of a single view.
    np.testing.assert_allclose(
        costs(POST, points, radii, sloping([0.0, 0.0], opposite, 1)), [0.3 * 0.03**2] * 2 + [0.0], atol=1e-7
    )


def test_inside_of_all_views_costs_nothing_and_unseen_points_neither():
    seen = sloping([-0.05, 0.05], [0.0, 0.0])
    points = jnp.array([[0.0, 0.0, 2.0], [3.0, 0.0, 2.0], [0.0, 0.0, -2.0]])
    found = costs(POST, points, jnp.full(3, 0.02), seen)
    np.testing.assert_array_equal(found[1:], 0.0)
    assert found[0] > 0
    np.testing.assert_array_equal(costs(POST, points, jnp.full(3, 0.02), sloping([-0.05, -0.05], [0.0, 0.0])), 0.0)


def test_cost_is_the_mean_over_points_on_the_axes():
    # The slope makes -60, 0 and 60 mm of the first capsule's points at x = -0.2, 0 and 0.2 m.
    out = 0.3 * np.array([-0.2, 0.0, 0.2]) + 0.7 * 0.02
    along = np.array([0.3, 0.0, 2.0]) + WHERE[:, None] * np.array([-0.2, 0.3, 0.2])
    out = np.concatenate([out, 0.3 * along[:, 0] + 0.7 * (0.02 + 0.04 * WHERE)])
    np.testing.assert_allclose(out[:3], [-0.046, 0.014, 0.074])
    out = np.maximum(out, 0)
    expected = np.minimum(out, 0.06) ** 2 + 0.3 * np.minimum(out, 0.03) ** 2
    cost = eqx.filter_jit(POST.cost)(AT_REST, sloping([0.0], [0.3]))
    np.testing.assert_allclose(cost, expected.mean(), rtol=1e-3)


# Its quadrics


def dense(term: InsideSilhouettes, ends: np.ndarray, base: np.ndarray, seen: Observed) -> float:
    """Weighted squares, point by point: weights as they were at the base, depths as they are at other ends."""
    assert seen.silhouettes is not None
    radii = np.asarray(term.body.radii)[np.asarray(term.body.links)]
    radii = (radii[:, :1] + WHERE * (radii[:, 1:] - radii[:, :1])).ravel()

    def depths(ends: np.ndarray) -> np.ndarray:
        points = (ends[:, None, 0] + WHERE[:, None] * (ends[:, 1] - ends[:, 0])[:, None]).reshape(-1, 3)
        return np.asarray(distances(seen, jnp.asarray(points))) + float(term.share) * radii

    out, then = depths(ends), depths(base)
    order = np.argsort(-then, 0, kind="stable")[int(seen.silhouettes.misses)]
    decides = np.arange(len(then))[:, None] == order
    weight = decides / (1 + (then / float(term.scale)) ** 2)
    weight = weight + float(term.single) / (1 + (then / float(term.single_scale)) ** 2) ** 2
    return float((np.where(then > 0, weight, 0.0) * out**2).sum() / out.shape[1])


@pytest.mark.parametrize("misses", [0, 1, 2])
def test_where_distances_are_linear_the_quadrics_are_the_dense_sum(misses):
    with jax.enable_x64(True):
        seen = sloping([0.01, 0.03, -0.02], [0.3, -0.2, 0.1], misses)
        fixed = eqx.filter_jit(POST.correspond)(AT_REST, seen)
        base = np.asarray(capsule_ends(POST.body, AT_REST.origins, AT_REST.rotations))
        for moves in (
            {},
            {"pelvis": [0.01, 0, 0]},
            {"l_hand": [-0.02, 0.03, 0.01]},
            {"pelvis": [0.05, 0, 0.1], "l_hand": [-0.05, 0, 0.02], "r_hand": [0.04, 0, -0.1]},
        ):
            body = shifted(AT_REST, **moves)
            ends = np.asarray(capsule_ends(POST.body, body.origins, body.rotations))
            # Ends that no view constrains are held by a millionth of their squared displacement.
            expected = dense(POST, ends, base, seen) + 1e-6 * ((ends - base) ** 2).sum()
            assert expected > 1e-6
            np.testing.assert_allclose((POST.residual(body, seen, fixed) ** 2).sum(), expected, rtol=1e-5)


@pytest.fixture(scope="module")
def filmed():
    """In float64: term, skeleton, a pose that sticks out here and there, and what was seen of some drawn limbs."""
    with jax.enable_x64(True):
        limbs = [chain([0.3, -0.2, 0.2], [0.3, -0.2, 1.5], 0.16), chain([0.3, -0.6, 1.2], [0.3, 0.2, 1.3], 0.07)]
        cameras = ring(4)
        masks = film(cameras, [np.vstack(limbs)])
        found = silhouette_distances(masks, cameras, np.zeros((1, 4), bool), 1)
        seen = observed(jax.tree.map(lambda a: a[0], found))
        return jax.tree.map(
            lambda a: jnp.asarray(a) if np.asarray(a).dtype.kind in "bi" else jnp.asarray(a, jnp.float64),
            (InsideSilhouettes(body=make_body(ADULT)), ADULT, pose_of(2, 0.3), seen),
        )


@pytest.mark.slow
def test_at_the_base_pose_the_residual_is_the_dense_sum_and_so_is_its_gradient(filmed):
    term, skeleton, base, seen = filmed
    with jax.enable_x64(True):

        def placed(unknowns):
            return place(skeleton, HINGED.retract(unknowns, base, skeleton))

        @jax.jit
        def ends(unknowns):
            body = placed(unknowns)
            return capsule_ends(term.body, body.origins, body.rotations)

        zeros = HINGED.unknowns(ADULT)
        fixed, start = eqx.filter_jit(term.correspond)(placed(zeros), seen), np.asarray(ends(zeros))
        value, gradient = jax.jit(
            jax.value_and_grad(lambda unknowns: (term.residual(placed(unknowns), seen, fixed) ** 2).sum())
        )(zeros)
        np.testing.assert_allclose(value, dense(term, start, start, seen), rtol=1e-6)
        assert value > 1e-4
        expected = []
        for row in 1e-6 * np.eye(len(zeros)):
            ahead, behind = (dense(term, np.asarray(ends(sign * row)), start, seen) for sign in (1, -1))
            expected.append((ahead - behind) / 2e-6)
        assert np.abs(expected).max() > 1e-3
        np.testing.assert_allclose(gradient, expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.slow
def test_jacobian_is_that_of_finite_differences(filmed):
    term, skeleton, base, seen = filmed
    with jax.enable_x64(True):
        zeros = HINGED.unknowns(ADULT)
        fixed = eqx.filter_jit(term.correspond)(place(skeleton, base), seen)

        @jax.jit
        def residual(unknowns):
            return term.residual(place(skeleton, HINGED.retract(unknowns, base, skeleton)), seen, fixed)

        jacobian = jax.jit(jax.jacfwd(residual))(zeros)
        expected = [(residual(row) - residual(-row)) / 2e-6 for row in 1e-6 * jnp.eye(len(zeros))]
        assert np.abs(jacobian).max() > 0.01
        np.testing.assert_allclose(jacobian, np.stack(expected, -1), atol=1e-7)


@pytest.mark.slow
def test_nothing_that_sticks_out_leaves_nothing_to_do(filmed):
    term, skeleton, base, seen = filmed
    with jax.enable_x64(True):
        silhouettes = seen.silhouettes
        inside = eqx.tree_at(lambda o: o.silhouettes.values, seen, jnp.full_like(silhouettes.values, -100.0))
        body = place(skeleton, base)
        assert float(term.cost(body, inside)) == 0
        residual = term.residual(body, inside, term.correspond(body, inside))
        np.testing.assert_allclose((residual**2).sum(), 0.0, atol=1e-11)
        assert float(term.cost(body, seen)) > 1e-4
