"""Weights learned from labels lower the error on frames without labels; only converged frames have a gradient."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.phantoms import ideal_graph, pose_of

from jaxskel import Pose, default_adult, learn_weights, refine_frames
from jaxskel.refinement.parametrisations import ExactBones
from jaxskel.refinement.solvers import NormalEquationsLM
from jaxskel.refinement.terms import Objective, RestPrior, from_function, place

pytestmark = pytest.mark.slow

ADULT = jax.tree.map(lambda a: np.asarray(a, np.float32), default_adult())
BONES = ExactBones()


def stack(*leaves):
    return jnp.stack([jnp.asarray(x) if x.dtype == bool else jnp.asarray(x, jnp.float32) for x in leaves])


POSES = [pose_of(seed, 0.25) for seed in range(16)]
TRUTH = np.stack([place(ADULT, pose).joints for pose in POSES])
RNG = np.random.default_rng(0)
NOISE = [0.005, 0.1]  # m: of good and of bad markers


def good(body, observed):
    """Markers with little noise, kept where the neck's node is kept."""
    return body.joints[1:8] - observed.paths[0, 1:8]


def bad(body, observed):
    """Markers with much noise."""
    return body.joints[1:8] - observed.paths[1, 1:8]


def seen():
    observed = jax.tree.map(stack, *(ideal_graph(ADULT, pose) for pose in POSES))
    paths = np.array(observed.paths)
    for row, noise in enumerate(NOISE):
        paths[:, row, 1:8] = TRUTH[:, 1:8] + RNG.normal(0, noise, (len(POSES), 7, 3))
    return jax.tree.map(lambda a: a, observed), jnp.asarray(paths)


GRAPHS, PATHS = seen()
OBSERVED = type(GRAPHS)(PATHS, GRAPHS.found, GRAPHS.inner)
INITIAL = jax.tree.map(stack, *POSES)
# Wrong start weights: bad markers count most.
START = Objective(
    {
        "good": from_function(good, weight=10.0, needs_graph=True),
        "bad": from_function(bad, weight=100.0, needs_graph=True),
        "rest": RestPrior(weight=0.1),
    }
)


def frames(tree, which):
    return jax.tree.map(lambda a: a[which], tree)


def error(objective, which) -> float:
    solver = NormalEquationsLM(rtol=1e-4, atol=1e-5)
    found = refine_frames(objective, BONES, solver, ADULT, frames(INITIAL, which), frames(OBSERVED, which), 2, 40)
    return float(np.linalg.norm(found.joints[:, :8] - TRUTH[which, :8], axis=-1).mean())


def test_learned_weights_help_frames_that_were_not_labelled():
    labelled, others = np.arange(6), np.arange(6, 16)
    labels = TRUTH[labelled].copy()
    labels[:, 8:] = np.nan
    learned = learn_weights(
        START, BONES, ADULT, frames(INITIAL, labelled), frames(OBSERVED, labelled), labels, rounds=2, iterations=12
    )
    assert learned.converged.all()
    assert learned.losses.min() < 0.5 * learned.losses[0]
    assert learned.weights["good"] > 10 * learned.weights["bad"]
    assert error(learned.objective, others) < 0.5 * error(START, others)


def test_labels_are_required():
    with pytest.raises(ValueError, match="every joint is NaN"):
        learn_weights(START, BONES, ADULT, INITIAL, OBSERVED, np.full((16, 15, 3), np.nan))


def test_starts_that_do_not_converge_are_refused():
    which = np.arange(6)
    nowhere = Pose(jnp.full((6, 3), jnp.nan), INITIAL.rotations[which])
    with pytest.raises(ValueError, match="no frame converges"):
        learn_weights(START, BONES, ADULT, nowhere, frames(OBSERVED, which), TRUTH[which], rounds=2)
