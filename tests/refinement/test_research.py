"""What researchers try: each term is a few lines beside its data, and other numbers in it compile nothing.

A floor that reaches the search is in `tests/search/test_search_objective.py`.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.observed_person import ADULT, BODY, CAMERAS, HINGED, UNKNOWNS, observe, turned
from support.phantoms import pose_of

from jaxskel import refine_frames, refine_sequence
from jaxskel.body import COCO_17, JOINT_NAMES
from jaxskel.cameras import project
from jaxskel.refinement.solvers import default_solver, sequence_solver
from jaxskel.refinement.terms import (
    AbstractCoupling,
    AbstractTerm,
    ContourContact,
    GemanMcClure,
    Objective,
    RestPrior,
    keypoints_term,
    number,
    place,
    volume_objective,
)

pytestmark = pytest.mark.slow

L_HAND, L_FOOT = (JOINT_NAMES.index(name) for name in ("l_hand", "l_foot"))
TRACED = []


@pytest.fixture(autouse=True)
def nothing_traced():
    TRACED.clear()


def counted(objective):
    """The same objective, with a term that counts how often it is traced."""
    return objective.plus(count=Counter(weight=1.0))


class Counter(AbstractTerm):
    weight: float
    needs_graph = False

    def residual(self, body, observed, fixed):
        TRACED.append(1)
        return 0.0 * body.joints[0]


def stacked(trees):
    return jax.tree.map(lambda *a: np.stack([np.asarray(x) for x in a]), *trees)


@pytest.fixture(scope="module")
def waving():
    """Two frames of a raised left arm, and starts in which it is 25 degrees lower."""
    truths = [turned("l_upper_arm", "x", angle) for angle in (70.0, 80.0)]
    starts = [turned("l_upper_arm", "x", angle) for angle in (45.0, 55.0)]
    return stacked(truths), stacked(starts), stacked([observe(truth) for truth in truths])


def hands(poses) -> np.ndarray:
    return np.stack([place(ADULT, jax.tree.map(lambda a, i=i: a[i], poses)).joints[L_HAND] for i in range(2)])


def refined(objective, starts, observed):
    return refine_frames(objective, HINGED, default_solver(), ADULT, starts, observed, 3, 16)


def test_keypoints_in_one_view_for_half_of_the_frames(waving):
    truths, starts, observed = waving
    term = keypoints_term(CAMERAS, COCO_17, weight=1.0)
    seen = np.full((2, len(CAMERAS), len(COCO_17), 3), np.nan)
    place_of_wrist = COCO_17.names.index("LWrist")
    body = place(ADULT, jax.tree.map(lambda a: a[0], truths))
    points = np.asarray(term.shares) @ np.concatenate([body.joints, body.tips, body.origins[13:]])
    u, v, _ = project(CAMERAS, points)
    seen[0, 2, place_of_wrist] = u[2, place_of_wrist], v[2, place_of_wrist], 1.0

    objective = counted(Objective({"keypoints": term, "rest": RestPrior(weight=0.01)}))
    given = jax.tree.map(jnp.asarray, observed).with_data(keypoints=seen)
    found = refined(objective, starts, given)
    before, after, there = hands(starts), np.asarray(found.joints[:, L_HAND]), hands(truths)
    across = np.asarray(CAMERAS.R)[2, :2]  # what this view sees
    assert np.linalg.norm(across @ (after - there)[0]) < 0.3 * np.linalg.norm(across @ (before - there)[0])
    assert np.linalg.norm(after[1] - before[1]) < 0.2  # no keypoints: only the prior
    traced = len(TRACED)
    refined(
        objective.weighted(keypoints=0.5), starts, jax.tree.map(jnp.asarray, observed).with_data(keypoints=seen + 3)
    )
    assert len(TRACED) == traced > 0


class Contact(AbstractCoupling):
    """A foot that is on the ground does not slide."""

    weight: jax.Array = eqx.field(converter=number, default=1.0)

    def residual(self, before, body, after):
        return jnp.concatenate(
            [body.joints[L_FOOT] - before.joints[L_FOOT], after.joints[L_FOOT] - body.joints[L_FOOT]]
        )


def test_foot_contact_over_time():
    truths = [pose_of(3, 0.1)] * 5
    rng = np.random.default_rng(0)
    starts = [HINGED.retract(jnp.asarray(rng.normal(0, 0.03, UNKNOWNS), jnp.float32), truth, ADULT) for truth in truths]
    starts = jax.tree.map(lambda a: np.asarray(a, np.float32), stacked(starts))
    observed = stacked([observe(turned("l_thigh", "y", 0.0))] * 5)
    priors = counted(Objective({"rest": RestPrior(weight=0.01)}))

    def slid(weight: float) -> float:
        objective = priors.plus(contact=Contact(weight=weight))
        found = refine_sequence(objective, HINGED, sequence_solver(), ADULT, starts, observed, 2, 16)
        return float(np.abs(np.diff(np.asarray(found.joints[:, L_FOOT]), axis=0)).max())

    loose = slid(1e-6)
    traced = len(TRACED)
    assert slid(1e4) < 0.2 * loose
    assert len(TRACED) == traced > 0


def test_a_geman_mcclure_loss_on_the_outlines(waving):
    truths, starts, observed = waving

    def off(scale: float) -> float:
        outlines = ContourContact(body=BODY, weight=1.2e5, scale=0.05, loss=GemanMcClure(scale))
        objective = counted(volume_objective(BODY).plus(contours=outlines))
        found = refined(objective, starts, observed)
        return float(np.linalg.norm(np.asarray(found.joints[:, L_HAND]) - hands(truths), axis=-1).max())

    assert off(1.0) < 0.05
    traced = len(TRACED)
    off(2.0)
    assert len(TRACED) == traced > 0


class Learned(AbstractTerm):
    """A small network that says how far a pose is from those it has learned."""

    network: eqx.nn.MLP
    weight: jax.Array = eqx.field(converter=number, default=1.0)
    needs_graph = False

    def residual(self, body, observed, fixed):
        return self.network((body.joints - body.joints[:1]).ravel())


def test_a_learned_prior_is_a_term_and_its_gradient_reaches_the_network(waving):
    _, starts, observed = waving

    def objective(seed: int) -> Objective:
        network = eqx.nn.MLP(45, 8, 16, 1, activation=jnp.tanh, key=jax.random.key(seed))
        return counted(Objective({"learned": Learned(network), "rest": RestPrior(weight=1.0)}))

    first = refined(objective(0), starts, observed)
    traced = len(TRACED)
    other = refined(objective(1), starts, observed)
    assert len(TRACED) == traced > 0
    assert first.finite.all()
    assert np.abs(np.asarray(first.joints) - np.asarray(other.joints)).max() > 1e-3
    assert (np.asarray(first.costs["learned"]) < sum_of(objective(0), starts)).all()


def sum_of(objective: Objective, starts) -> np.ndarray:
    """What the network says of the starts."""
    bodies = [place(ADULT, jax.tree.map(lambda a, i=i: jnp.asarray(a[i]), starts)) for i in range(2)]
    return np.array([(objective.terms["learned"].residual(body, None, None) ** 2).sum() for body in bodies])
