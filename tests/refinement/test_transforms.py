"""Refinement inside of JAX's transformations: compiled, vectorised and differentiated, by cameras and bodies, too."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.phantoms import ideal_graph, pose_of, ring

from jaxskel import default_adult, refine_frames
from jaxskel.body import COCO_17
from jaxskel.refinement.parametrisations import ExactBones
from jaxskel.refinement.solvers import NormalEquationsLM
from jaxskel.refinement.terms import Huber, Objective, RestPrior, keypoints_term, place

pytestmark = pytest.mark.slow

ADULT, BONES = default_adult(), ExactBones()
CAMERAS = ring(4, (320, 320), 360.0, height=0.2)
AT = {"weight": np.array(0.5), "scale": np.array(1.02), "shift": np.array([0.01, -0.02, 0.005])}


def doubled(tree):
    return jax.tree.map(lambda a: a if np.asarray(a).dtype.kind in "bi" else jnp.asarray(a, jnp.float64), tree)


@pytest.fixture(scope="module", autouse=True)
def in_double_precision():
    with jax.enable_x64(True):
        yield


@pytest.fixture(scope="module")
def joints():
    """Joints (m) of two frames refined to their keypoints, by weight, size of the body, and shift of a camera (m)."""
    # Distances are in the range in which the loss is a square, so that the solves converge to rounding.
    term = keypoints_term(CAMERAS, COCO_17, weight=1.0, loss=Huber(20.0))
    shares = np.asarray(term.shares)
    truths = [doubled(pose_of(seed, 0.3)) for seed in (3, 4)]
    starts, observed = [], []
    for seed, truth in enumerate(truths):
        rng = np.random.default_rng(seed)
        points = term._projected(place(doubled(ADULT), truth))
        seen = np.asarray(points[..., :2] / points[..., 2:]) + rng.normal(0, 2.0, points.shape[:-1] + (2,))
        data = np.concatenate([seen, np.ones((*seen.shape[:2], 1))], -1)
        graph = jax.tree.map(lambda a: np.asarray(a)[None], ideal_graph(ADULT, truth))
        observed.append(graph.with_data(keypoints=data[None]))
        starts.append(BONES.retract(jnp.asarray(0.05 * rng.normal(size=31)), truth, doubled(ADULT)))
    assert shares.any(1).sum() > 10
    initial = jax.tree.map(lambda *a: jnp.stack(a), *starts)
    stack = doubled(jax.tree.map(lambda *a: jnp.concatenate([jnp.asarray(x) for x in a]), *observed))
    solver = NormalEquationsLM(rtol=1e-11, atol=1e-11)

    def refined(given):
        moved = term.matrices.at[0, :, 3].add(term.matrices[0, :, :3] @ given["shift"])
        own = eqx.tree_at(lambda t: t.matrices, term, moved)
        objective = Objective({"keypoints": own, "rest": RestPrior(weight=1.0)}).weighted(rest=given["weight"])
        skeleton = jax.tree.map(lambda a: a * given["scale"], doubled(ADULT))
        found = refine_frames(objective, BONES, solver, skeleton, initial, stack, 4, 300)
        return jnp.where(found.converged[:, None, None], found.joints, jnp.nan)

    return refined


@pytest.fixture(scope="module")
def compiled(joints):
    return jax.jit(joints)


def test_compiled_or_not_is_the_same(joints, compiled):
    found = compiled(AT)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(joints(AT), found, atol=1e-7)


@pytest.mark.parametrize("name", AT)
def test_several_weights_bodies_or_cameras_at_once(joints, compiled, name):
    several = np.stack([AT[name], 1.1 * AT[name]])
    together = jax.jit(jax.vmap(lambda value: joints(AT | {name: value})))(several)
    for one, value in zip(together, several, strict=True):
        np.testing.assert_allclose(one, compiled(AT | {name: value}), atol=1e-7)


def test_derivatives_are_finite_differences(joints, compiled):
    along = np.random.default_rng(0).normal(size=(2, 15, 3))
    slopes = jax.jit(jax.grad(lambda given: (joints(given) * along).sum()))(AT)
    jacobian = jax.jit(jax.jacrev(lambda given: jnp.tensordot(joints(given), along, 3)[None]))(AT)
    step = 1e-3  # the solves end some 1e-8 m from where they should
    for name, value in AT.items():
        for entry in np.ndindex(np.shape(value)):
            off = np.zeros(np.shape(value))
            off[entry] = step
            ends = [(compiled(AT | {name: value + sign * off}) * along).sum() for sign in (1, -1)]
            expected = (ends[0] - ends[1]) / (2 * step)
            np.testing.assert_allclose(slopes[name][entry], expected, rtol=2e-3, atol=1e-4)
            np.testing.assert_allclose(jacobian[name][0][entry], expected, rtol=2e-3, atol=1e-4)
