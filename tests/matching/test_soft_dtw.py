from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jax.test_util import check_grads
from scipy.special import logsumexp

from jaxskel import default_adult
from jaxskel.matching import cost_matrices, dtw, soft_cost_matrices, soft_dtw, template_ends

pytestmark = pytest.mark.slow

LENGTH, TEMPLATE = 6, 4
# Few enough that elements are often equal, which is where the absolute value has its kink.
numbers = st.integers(0, 60).map(lambda n: n / 20)
sequences = st.lists(numbers, min_size=1, max_size=LENGTH)
templates = st.lists(numbers, min_size=TEMPLATE, max_size=TEMPLATE)
gammas = st.floats(0.01, 10.0)
hard, soft = jax.jit(dtw), jax.jit(soft_dtw)
slopes = jax.jit(jax.grad(soft_dtw, (0, 2, 3)))


def padded(a, padding=0.0) -> np.ndarray:
    """To one size, so that few shapes are compiled."""
    return np.array(list(a) + [padding] * (LENGTH - len(a)), float)


def ours(a, b, gamma, padding=0.0) -> float:
    with jax.enable_x64(True):
        return float(soft(padded(a, padding), np.array(len(a)), np.array(b, float), np.array(gamma, float)))


def gradient(a, b, gamma, padding=0.0) -> list[np.ndarray]:
    """Gradients by the first sequence, the second one and gamma."""
    with jax.enable_x64(True):
        found = slopes(padded(a, padding), np.array(len(a)), np.array(b, float), np.array(gamma, float))
    return [np.asarray(part) for part in found]


@cache
def warping_paths(rows: int, columns: int) -> list[np.ndarray]:
    """The pairs that each warping path goes through."""
    if (rows, columns) == (1, 1):
        return [np.ones((1, 1))]
    found = []
    for r, c in ((rows - 1, columns), (rows, columns - 1), (rows - 1, columns - 1)):
        for path in warping_paths(r, c) if r and c else ():
            longer = np.zeros((rows, columns))
            longer[:r, :c] = path
            longer[-1, -1] = 1.0
            found.append(longer)
    return found


def every_cost(a, b) -> np.ndarray:
    cost = np.abs(np.subtract.outer(a, b))
    return np.array([(path * cost).sum() for path in warping_paths(len(a), len(b))])


@settings(deadline=None)
@given(sequences, templates, gammas)
def test_soft_dtw_is_the_soft_minimum_over_all_warping_paths(a, b, gamma):
    assert abs(ours(a, b, gamma) + gamma * logsumexp(-every_cost(a, b) / gamma)) < 1e-9


def test_soft_dtw_by_hand():
    # One element has one way to warp; two with two have three, here of costs 0, 1 and 1.
    assert ours([2.0], [1.0, 2.5, 4.0], 0.7) == pytest.approx(1.0 + 0.5 + 2.0)
    assert ours([0.0, 1.0], [0.0, 1.0], 0.5) == pytest.approx(-0.5 * np.log(1 + 2 * np.exp(-2.0)))


@settings(deadline=None)
@given(sequences, templates)
def test_it_becomes_dtw_as_gamma_goes_to_zero(a, b):
    with jax.enable_x64(True):
        exact = float(hard(padded(a), np.array(len(a)), np.array(b, float)))
    distances = [exact - ours(a, b, gamma) for gamma in (1.0, 0.1, 1e-3, 1e-6)]
    # Never above it, and below it at most by the value for which all paths are as cheap as the cheapest.
    for gamma, below in zip((1.0, 0.1, 1e-3, 1e-6), distances, strict=True):
        assert -1e-9 < below <= gamma * np.log(len(warping_paths(len(a), len(b)))) + 1e-9
    assert (np.diff(distances) < 1e-9).all()


@settings(deadline=None)
@given(sequences, templates, gammas, st.sampled_from([-1.0, 1e9, np.inf, np.nan]))
def test_padding_does_not_matter_and_has_no_gradient(a, b, gamma, padding):
    assert ours(a, b, gamma, padding) == ours(a, b, gamma)
    for found, expected in zip(gradient(a, b, gamma, padding), gradient(a, b, gamma), strict=True):
        np.testing.assert_array_equal(found, expected)
        assert np.isfinite(found).all()
    assert (gradient(a, b, gamma, padding)[0][len(a) :] == 0).all()


@settings(deadline=None)
@given(sequences, templates, gammas)
def test_gradient_weighs_the_warping_paths_by_their_cost(a, b, gamma):
    # Where an element equals its partner, the absolute value counts as flat: sign(0) = 0.
    costs = every_cost(a, b)
    weights = np.exp(-costs / gamma - logsumexp(-costs / gamma))
    pairs = sum(w * path for w, path in zip(weights, warping_paths(len(a), len(b)), strict=True))
    pulls = pairs * np.sign(np.subtract.outer(a, b))
    by_a, by_b, _ = gradient(a, b, gamma)
    np.testing.assert_allclose(by_a[: len(a)], pulls.sum(1), atol=1e-9)
    np.testing.assert_allclose(by_b, -pulls.sum(0), atol=1e-9)


@pytest.mark.parametrize(("length", "gamma"), [(1, 0.3), (5, 0.05), (9, 0.2), (16, 1.0)])
def test_gradients_are_finite_differences(length, gamma):
    rng = np.random.default_rng(length)
    with jax.enable_x64(True):
        a, b = jnp.asarray(rng.uniform(0, 2, 16)), jnp.asarray(rng.uniform(0, 2, 5))
        n = jnp.asarray(length)
        check_grads(lambda *given: soft(given[0], n, *given[1:]), (a, b, jnp.asarray(gamma)), 1, eps=1e-6)


def test_an_empty_sequence_cannot_be_warped_and_has_no_gradient():
    assert ours([], [1.0, 2.0, 3.0, 4.0], 0.1, np.nan) == np.inf
    for part in gradient([], [1.0, 2.0, 3.0, 4.0], 0.1, np.nan):
        np.testing.assert_array_equal(part, 0.0)


def test_single_precision_is_kept_and_small_gammas_do_not_overflow():
    # Paths cost up to 80 m here, which are 80 million gammas.
    a, b = jnp.full(16, 2.0, jnp.float32), jnp.asarray([0.0, 1.0, 2.0, 3.0, 7.0], jnp.float32)
    cost, by_a = jax.value_and_grad(soft_dtw)(a, jnp.asarray(16), b, 1e-6)
    assert cost.dtype == jnp.float32
    assert cost == pytest.approx(float(dtw(a, jnp.asarray(16), b)), rel=1e-6)
    assert np.isfinite(by_a).all()


def random_rows(frames: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distances of end nodes, their numbers, and the template's distances."""
    rng = np.random.default_rng(0)
    distances = rng.uniform(0, 2, (frames, 16, 16)).astype(np.float32)
    return distances, np.array([5, 9, 16, 1][:frames], np.int32), template_ends(default_adult())


def test_soft_cost_matrices_are_soft_dtw_of_each_pair_of_rows():
    distances, count, template = random_rows(4)
    gamma = np.float32(0.05)
    costs = np.asarray(soft_cost_matrices(distances, count, template, gamma))
    one = jax.jit(soft_dtw)
    for f, end, label in [(0, 4, 3), (1, 0, 0), (1, 8, 2), (2, 15, 4), (3, 0, 1)]:
        expected = one(distances[f, end], count[f], template[label], gamma)
        np.testing.assert_allclose(costs[f, end, label], expected, rtol=1e-5)
    np.testing.assert_array_equal(np.isinf(costs), np.isinf(cost_matrices(distances, count, template)))
    sharp = soft_cost_matrices(distances, count, template, np.float32(1e-6))
    np.testing.assert_allclose(sharp, cost_matrices(distances, count, template), rtol=1e-5)


def test_gradient_of_soft_cost_matrices_stays_within_the_end_nodes():
    distances, count, template = random_rows(4)
    there = np.arange(16) < count[:, None]
    distances[~(there[:, :, None] & there[:, None])] = np.nan

    def total(distances):
        costs = soft_cost_matrices(distances, count, template, np.float32(0.05))
        return jnp.where(jnp.isinf(costs), 0.0, costs).sum()

    slope = np.asarray(jax.jit(jax.grad(total))(distances))
    inside = there[:, :, None] & there[:, None]
    assert (slope[~inside] == 0).all()
    assert (slope[inside] != 0).mean() > 0.99
