"""The search minimises the objective it is given: its terms score limbs, fit hypotheses and choose between them."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.capsule_films import ADULT, BODY, Filmed, film_body, joints_of, some

from jaxskel._runtime.batching import on_device
from jaxskel.body import JOINT_NAMES
from jaxskel.refinement.terms import (
    AbstractTerm,
    CapsuleTerm,
    HingeLimits,
    Objective,
    RestPrior,
    Smoothness,
    from_function,
    paper_objective,
    volume_objective,
)
from jaxskel.search import Search, costs_by_term, make_model, solve_frames
from jaxskel.search._gauss_newton import _by_body
from jaxskel.search._limb_search import scores_limbs
from jaxskel.synthetic import demo_motion

L_HAND = JOINT_NAMES.index("l_hand")
FRAMES = [7, 18]  # of the demo motion at 5 frames a second: a walk, and waving
SEARCH = Search(doubtful=np.inf, again=1)
STOUT = jax.tree.map(lambda a: a if a.dtype.kind == "i" else 1.1 * np.asarray(a, np.float32), BODY)


class Floor(AbstractTerm):
    """Nothing is below a height; also scores the tables of limbs."""

    weight: float
    height: float

    needs_graph = False

    def residual(self, body, observed, fixed):
        return jnp.minimum(jnp.concatenate([body.joints, body.tips])[:, 2] - self.height, 0.0)

    def ball_costs(self, points, radii, observed):
        return jnp.minimum(points[:, 2] - radii - self.height, 0.0) ** 2


def to_marker(body, observed):
    marker = observed.data["marker"]
    return jnp.where(jnp.isnan(marker), 0.0, body.joints[L_HAND] - marker)


def same_arrays(one, other) -> bool:
    """Whether two trees hold the very same arrays, so that they are one argument of what is compiled."""
    return all(a is b for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True))


# What terms say of themselves


def test_a_term_is_given_another_subject_wherever_it_holds_one():
    objective = volume_objective(BODY).of_body(STOUT)
    for name in ("contours", "inside", "collision"):
        assert same_arrays(objective.terms[name].body, STOUT)
    for name in ("hinges", "shoulders"):
        assert same_arrays(objective.terms[name].skeleton, STOUT.skeleton)
    assert objective.terms["rest"].weight == volume_objective(BODY).terms["rest"].weight


def test_only_terms_with_a_robust_scale_have_another_one():
    objective = volume_objective(BODY)
    wide = objective.at_scale(jnp.float32(0.5))
    assert wide.terms["contours"].scale == 0.5
    assert all(same_arrays(wide.terms[name], term) for name, term in objective.terms.items() if name != "contours")


@pytest.mark.parametrize(
    ("objective", "scores"),
    [
        (volume_objective(BODY), True),
        (paper_objective(), False),
        (Objective({"floor": Floor(1.0, 0.0)}), True),
        (Objective({"rest": RestPrior(), "hinges": HingeLimits(skeleton=ADULT)}), False),
    ],
    ids=["volume", "graph", "floor", "priors"],
)
def test_tables_are_scored_by_terms_that_can(objective, scores):
    assert scores_limbs(objective) is scores


def test_a_search_looks_at_single_frames():
    coupled = volume_objective(BODY).plus(smooth=Smoothness(fps=30.0, weight=1.0))
    with pytest.raises(ValueError, match="a search looks at single frames, but smooth couples them"):
        make_model(BODY, coupled)


# Winners


@pytest.fixture(scope="module")
def filmed() -> Filmed:
    """Two frames; a marker says that the left hand is 30 cm from where it is, towards the trunk, in the first one."""
    filmed = film_body(some(demo_motion(ADULT), FRAMES), 5.0)
    marker = filmed.joints[:, L_HAND] + 0.3 * np.array([0.0, 0.0, 1.0])
    marker[1] = np.nan
    return replace(filmed, observed=filmed.observed.with_data(marker=marker))


def winners(filmed: Filmed, objective) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Joints of the cheapest hypotheses (m), and the costs of all by term."""
    model = make_model(BODY, objective)
    stack = on_device(filmed.observed)
    found = solve_frames(model, SEARCH, filmed.starts, filmed.fallback, stack)
    return joints_of(found.best), costs_by_term(model.objective, model.skeleton, found.poses, stack) | {
        "sum": found.cost
    }


@pytest.fixture(scope="module")
def by_silhouettes(filmed):
    return winners(filmed, volume_objective)


@pytest.fixture(scope="module")
def by_marker(filmed):
    marker = from_function(to_marker, weight=3e3)
    return winners(filmed, lambda body: volume_objective(body).plus(marker=marker))


@pytest.fixture(scope="module")
def by_graph(filmed):
    return winners(filmed, paper_objective().plus(hinges=HingeLimits(skeleton=ADULT, weight=40.0)))


@pytest.mark.slow
def test_silhouettes_find_the_hand_and_a_marker_takes_it_away(filmed, by_silhouettes, by_marker):
    away = np.linalg.norm(by_silhouettes[0] - filmed.joints, axis=-1)
    assert away.max() < 0.1
    pulled = by_marker[0][:, L_HAND, 2] - by_silhouettes[0][:, L_HAND, 2]
    assert pulled[0] > 0.15
    assert abs(pulled[1]) < 0.02  # no marker in this frame


@pytest.mark.slow
def test_the_graph_alone_has_another_winner(by_graph, by_silhouettes, by_marker):
    assert set(by_graph[1]) == {"graph", "end_nodes", "inner_nodes", "rest", "hinges", "sum"}
    apart = np.linalg.norm(by_graph[0] - by_silhouettes[0], axis=-1).max(-1)
    assert (apart > 0.03).all()  # the graph lies short of the tips, and its nodes are no joints
    assert np.isfinite(by_graph[0]).all()


@pytest.mark.slow
@pytest.mark.parametrize("which", ["by_silhouettes", "by_marker", "by_graph"])
def test_costs_by_term_add_up_to_what_the_search_says(which, request):
    costs = dict(request.getfixturevalue(which)[1])
    total = costs.pop("sum")
    there = np.isfinite(total)
    assert there[:, 0].all()
    np.testing.assert_allclose(sum(costs.values())[there], total[there], rtol=2e-3, atol=1e-3)


@pytest.mark.slow
def test_a_floor_reaches_the_tables_of_limbs_and_its_numbers_compile_nothing(filmed, monkeypatch):
    ground = float(filmed.joints[:, [11, 14], 2].min()) + 0.3
    traced = []
    usual = Floor.residual

    def residual(self, body, observed, fixed):
        traced.append(1)
        return usual(self, body, observed, fixed)

    monkeypatch.setattr(Floor, "residual", residual)

    def lowest(height: float) -> float:
        objective = lambda body: volume_objective(body).plus(floor=Floor(3e3, height))  # noqa: E731
        return float(winners(filmed, objective)[0][:, :, 2].min())

    free = lowest(ground - 1.0)
    before = len(traced)
    assert before > 0
    raised = lowest(ground)
    assert len(traced) == before
    assert raised > free + 0.15


def test_terms_of_one_body_are_one_group_of_the_normal_equations():
    terms = [term for term in volume_objective(BODY).of_body(STOUT).terms.values() if isinstance(term, CapsuleTerm)]
    assert len(terms) == 2
    assert len(_by_body(terms)) == 1
    assert len(_by_body([*terms, volume_objective(BODY).terms["inside"]])) == 2
