"""Gradients through the refinement, by the implicit function theorem, against finite differences of whole solves."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.phantoms import ideal_graph, pose_of

from jaxskel import default_adult
from jaxskel._runtime.batching import single_precision
from jaxskel.refinement import refine_frame
from jaxskel.refinement.parametrisations import ExactBones
from jaxskel.refinement.solvers import NormalEquationsLM
from jaxskel.refinement.terms import paper_objective

pytestmark = pytest.mark.slow

ADULT = default_adult()
BONES = ExactBones()


def doubled(tree):
    return jax.tree.map(lambda a: a if np.asarray(a).dtype.kind in "bi" else jnp.asarray(a, jnp.float64), tree)


@pytest.fixture(scope="module")
def problem():
    """In float64: a frame with a noisy graph, and a scalar function of its refined joints for all parameters."""
    rng = np.random.default_rng(0)
    with jax.enable_x64(True):
        truth = pose_of(3, 0.3)
        observed = ideal_graph(ADULT, truth)
        noise = rng.normal(0, 0.01, observed.paths.shape)
        observed = doubled(eqx.tree_at(lambda o: o.paths, observed, observed.paths + noise))
        start = BONES.retract(jnp.asarray(0.02 * rng.normal(size=31)), doubled(truth), doubled(ADULT))
        objective = doubled(paper_objective()).weighted(rest=10.0)
        along = jnp.asarray(rng.normal(size=(15, 3)))

        @eqx.filter_jit
        def number(given):
            objective, observed, skeleton = given
            solver = NormalEquationsLM(rtol=1e-10, atol=1e-10)
            # Rounds enough that the correspondences have settled too.
            found = refine_frame(objective, BONES, solver, skeleton, start, observed, rounds=3, max_steps=400)
            return (found.joints * along).sum(), found.converged

        return number, (objective, observed, doubled(ADULT))


def test_a_solve_that_has_not_converged_has_no_gradient():
    pose = pose_of(3, 0.3)
    observed, start, adult = single_precision((ideal_graph(ADULT, pose), pose_of(4, 0.3), ADULT))

    def away(weight):
        objective = paper_objective().weighted(rest=weight)
        found = refine_frame(objective, BONES, NormalEquationsLM(rtol=1e-9, atol=1e-9), adult, start, observed, 1, 2)
        return (found.joints**2).sum(), found.converged

    slope, converged = jax.jit(jax.grad(away, has_aux=True))(2.0)
    assert not converged
    assert np.isnan(slope)


def test_the_solve_converges_to_rounding(problem):
    number, given = problem
    with jax.enable_x64(True):
        assert number(given)[1]


# What is differentiated by: weights, what was observed, the template's lengths, a robust scale.
PLACES = {
    "weights": lambda given: [term.weight for term in given[0].terms.values()],
    "graph": lambda given: [given[1].paths, given[1].inner],
    "skeleton": lambda given: [given[2].rest_joints, given[2].rest_tips],
    "scale": lambda given: [given[0].terms["graph"].scale],
}


def test_gradients_are_finite_differences_of_whole_solves(problem):
    number, given = problem
    with jax.enable_x64(True):
        numbers, rest = eqx.partition(given, eqx.is_inexact_array)
        gradient = eqx.filter_jit(jax.grad(lambda numbers: number(eqx.combine(numbers, rest))[0]))(numbers)
        rng, step = np.random.default_rng(1), 1e-4
        for name, place in PLACES.items():
            values, slopes = place(given), place(gradient)
            # Relative, so that weights of hundreds change by more than a solve is off.
            direction = [jnp.abs(v).max() * jnp.asarray(rng.normal(size=v.shape)) for v in values]
            ahead, behind = (
                number(eqx.tree_at(place, given, [v + s * step * d for v, d in zip(values, direction, strict=True)]))
                for s in (1, -1)
            )
            assert ahead[1], name
            assert behind[1], name
            divided = float(ahead[0] - behind[0]) / (2 * step)
            derived = float(sum((g * d).sum() for g, d in zip(slopes, direction, strict=True)))
            assert abs(divided) > 1e-5, name
            np.testing.assert_allclose(derived, divided, rtol=5e-3, atol=1e-7, err_msg=name)
