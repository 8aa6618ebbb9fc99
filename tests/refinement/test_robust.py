"""Robust losses: closed forms, Jacobians, what an outlier does, and that every solver can minimise them."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import optimistix as optx
import pytest
from support.observed_person import ADULT, BODY, observe, standing, turned
from support.phantoms import pose_of

from jaxskel.refinement.solvers import NormalEquationsLM
from jaxskel.refinement.terms import (
    AbstractLoss,
    Cauchy,
    ContourContact,
    EndNodeAttraction,
    GemanMcClure,
    Huber,
    InsideSilhouettes,
    Objective,
    Robust,
    Smoothness,
    from_function,
    place,
    robust_rows,
)

K = 0.5


class Welsch(AbstractLoss):
    """A loss of one's own: one method is enough."""

    scale: jax.Array

    def ratio(self, squared):
        share = jnp.maximum(squared / self.scale**2, 1e-9)
        return -jnp.expm1(-share) / share


LOSSES = {
    "Huber": (Huber(K), lambda s: np.where(s <= K**2, s, 2 * K * np.sqrt(s) - K**2)),
    "Cauchy": (Cauchy(K), lambda s: K**2 * np.log1p(s / K**2)),
    "Geman-McClure": (GemanMcClure(K), lambda s: s / (1 + s / K**2)),
    "own": (Welsch(jnp.asarray(K)), lambda s: -(K**2) * np.expm1(-s / K**2)),
}
each_loss = pytest.mark.parametrize("name", LOSSES)
# Zero, tiny, around the scale, and far beyond it.
LENGTHS = np.array([0.0, 1e-6, 0.01, 0.0158, 0.0159, 0.3, 0.4999, 0.5001, 2.0, 100.0, 1e4])


def vectors(group: int) -> jax.Array:
    """Of these lengths, in any direction."""
    directions = np.random.default_rng(0).normal(size=(len(LENGTHS), group))
    return jnp.asarray(LENGTHS[:, None] * directions / np.linalg.norm(directions, axis=1, keepdims=True))


@each_loss
@pytest.mark.parametrize("group", [1, 2, 3])
def test_the_squared_norm_is_the_closed_form(name, group):
    loss, closed = LOSSES[name]
    with jax.enable_x64(True):
        loss = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), loss)
        rows = robust_rows(loss, vectors(group))
        np.testing.assert_allclose((rows**2).sum(1), closed(LENGTHS**2), rtol=1e-9, atol=1e-18)
        np.testing.assert_allclose(loss.cost(jnp.asarray(LENGTHS**2)), closed(LENGTHS**2), rtol=1e-9, atol=1e-18)


@each_loss
@pytest.mark.parametrize("group", [1, 3])
def test_the_jacobian_is_finite_differences(name, group):
    with jax.enable_x64(True):
        loss = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), LOSSES[name][0])
        here, along = vectors(group), jnp.asarray(np.random.default_rng(1).normal(size=(len(LENGTHS), group)))
        derived = jax.jvp(lambda r: robust_rows(loss, r), (here,), (along,))[1]
        step = 1e-6 * np.maximum(1.0, LENGTHS)[:, None]
        ahead, behind = (robust_rows(loss, here + sign * step * along) for sign in (1, -1))
        assert np.isfinite(derived).all()
        np.testing.assert_allclose(derived, (ahead - behind) / (2 * step), atol=1e-6)


@each_loss
def test_a_weight_is_the_derivative_of_the_cost_and_falls(name):
    loss, closed = LOSSES[name]
    squared = np.linspace(0.001, 4, 200)
    weight = np.asarray(loss.weight(jnp.asarray(squared, jnp.float32)))
    np.testing.assert_allclose(weight, (closed(squared + 1e-6) - closed(squared - 1e-6)) / 2e-6, rtol=1e-3, atol=1e-5)
    assert (np.diff(weight) < 1e-6).all()
    assert weight[0] == pytest.approx(1.0, abs=0.02)


def test_the_gauss_newton_matrix_of_geman_mcclure_is_that_of_reweighted_least_squares():
    loss = GemanMcClure(K)
    for row in vectors(3)[1:8]:
        jacobian = jax.jacobian(lambda r: robust_rows(loss, r[None])[0])(row)
        np.testing.assert_allclose(jacobian.T @ jacobian, loss.weight((row**2).sum()[None])[0] * np.eye(3), atol=2e-5)


SOLVERS = {
    "LevenbergMarquardt": optx.LevenbergMarquardt(1e-6, 1e-6),
    "NormalEquationsLM": NormalEquationsLM(rtol=1e-6, atol=1e-6),
    "BFGS": optx.BFGS(1e-6, 1e-6),
}
SEEN = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1], [0.1, 0.1], [0.05, 0.05], [40.0, -30.0]])  # the last one is wrong


@pytest.mark.parametrize("solver", SOLVERS)
@each_loss
def test_an_outlier_hardly_pulls_by_any_solver(name, solver):
    loss = LOSSES[name][0]

    def residual(place, args):
        return robust_rows(loss, place[None] - jnp.asarray(SEEN, jnp.float32))

    found = optx.least_squares(residual, SOLVERS[solver], jnp.array([0.6, -0.5]), max_steps=200, throw=False)
    pulled = np.linalg.norm(np.asarray(found.value) - 0.05)
    # The mean is 8 away. Huber's outlier pulls like one at the scale, the others do not pull.
    assert pulled < (0.12 if name == "Huber" else 0.01)
    # It is a minimum of the closed form.
    closed = lambda place: LOSSES[name][1](((place - SEEN) ** 2).sum(1)).sum()  # noqa: E731
    best = min(closed(np.asarray(found.value) + 0.01 * np.array([np.cos(a), np.sin(a)])) for a in np.arange(0, 6, 0.5))
    assert closed(np.asarray(found.value, np.float64)) < best


def points(body, observed, goal):
    return body.joints - goal


def robust(loss: AbstractLoss, group: int = 3) -> Robust:
    goal = place(ADULT, pose_of(1)).joints.at[3].add(10.0)
    return Robust(from_function(points, goal, weight=7.0, needs_graph=True), loss, group)


@each_loss
def test_a_robust_term_costs_the_loss_of_each_vector(name):
    loss, closed = LOSSES[name]
    term, body = robust(loss), place(ADULT, pose_of(2))
    observed = observe(standing())
    goal = np.asarray(jax.tree.leaves(term.term)[0])
    squared = np.asarray(((body.joints - goal) ** 2).sum(1), np.float64)
    costs = Objective({"robust": term}).weighted(robust=9.0).costs(body, observed)
    np.testing.assert_allclose(costs["robust"], 9 * closed(squared).sum(), rtol=1e-4)
    assert (term.weight, term.needs_graph, term.needs_outlines) == (7.0, True, False)


def some(*arguments: Any) -> tuple[Any, ...]:
    return arguments  # of wrong kinds, too


def test_new_scales_and_weights_trace_nothing():
    traces, body, observed = [], place(ADULT, pose_of(2)), observe(standing())

    @eqx.filter_jit
    def cost(objective):
        traces.append(1)
        return objective.costs(body, observed)["robust"]

    first, second = (cost(Objective({"robust": robust(GemanMcClure(scale))})) for scale in (1, 0.25))
    assert len(traces) == 1
    assert first > 2 * second


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: Robust(ContourContact(body=BODY), Huber(1)),
            r"term: ContourContact sums up.*ContourContact\(body, loss=",
        ),
        (lambda: Robust(InsideSilhouettes(body=BODY), Huber(1)), "term: InsideSilhouettes sums up its points"),
        (lambda: Robust(*some(Smoothness(fps=30.0), Huber(1))), "term: is a Smoothness; give a term of single frames"),
        (lambda: Robust(*some(EndNodeAttraction, Huber(1))), "term: is the class EndNodeAttraction"),
        (lambda: Robust(*some(EndNodeAttraction(), 0.1)), "loss: is a float; give a loss, such as"),
        (lambda: Robust(EndNodeAttraction(), Huber(1), 0), "group: is 0; give a whole number, 1 or more"),
        (lambda: Huber(0), "scale: is 0; give a positive number"),
        (lambda: GemanMcClure(float("nan")), "scale: is nan; give a positive number"),
    ],
)
def test_what_cannot_be_made_robust_is_refused(make, message, monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # as for a user
    with pytest.raises(ValueError, match=message) as told:
        make()
    assert "\n" not in str(told.value)


def test_a_group_that_does_not_divide_the_residuals_is_refused():
    body = place(ADULT, pose_of(2))
    with pytest.raises(ValueError, match="group: is 4, but the term has 45 residuals; give a divisor of that"):
        robust(Huber(1), 4).residual(body, observe(standing()), None)


def test_outlines_take_a_loss_in_units_of_the_scale():
    observed, body = observe(standing()), place(ADULT, turned("l_upper_arm", "x", 40))
    plain, same = ContourContact(body=BODY), ContourContact(body=BODY, loss=GemanMcClure(1.0))
    near, weights = plain.nearest(body, observed)
    np.testing.assert_allclose(same.nearest(body, observed)[1], weights, rtol=1e-5)
    for name, (loss, closed) in LOSSES.items():
        term = ContourContact(body=BODY, inner=1.0, scale=0.04, loss=loss)
        distance = np.asarray(near.distance, np.float64)
        expected = 0.04**2 * closed((distance / 0.04) ** 2).mean()
        np.testing.assert_allclose(term.cost(body, observed), expected, rtol=1e-4, err_msg=name)
