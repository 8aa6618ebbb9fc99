from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxskel.matching import dtw

LENGTH, TEMPLATE = 6, 4
numbers = st.lists(st.floats(0, 3), min_size=1, max_size=LENGTH)
templates = st.lists(st.floats(0, 3), min_size=TEMPLATE, max_size=TEMPLATE)
jitted = jax.jit(dtw)


def ours(a, b, padding=0.0, size=LENGTH) -> float:
    """In float64, padded to one size so that few shapes are compiled."""
    with jax.enable_x64(True):
        padded = jnp.asarray(list(a) + [padding] * (size - len(a)), float)
        return float(jitted(padded, jnp.asarray(len(a)), jnp.asarray(b, float)))


@cache
def warping_paths(rows: int, columns: int) -> list[list[tuple[int, int]]]:
    """All warping paths from the first pair to the last one, by steps in one sequence, the other, or both."""
    if (rows, columns) == (1, 1):
        return [[(0, 0)]]
    before = [(r, c) for r, c in ((rows - 1, columns), (rows, columns - 1), (rows - 1, columns - 1)) if r and c]
    return [[*path, (rows - 1, columns - 1)] for r, c in before for path in warping_paths(r, c)]


def test_there_are_as_many_warping_paths_as_delannoy_counted():
    assert [len(warping_paths(n, n)) for n in range(1, 6)] == [1, 3, 13, 63, 321]
    assert len(warping_paths(3, 4)) == 25


@settings(deadline=None)
@given(numbers, templates)
def test_dtw_is_the_cheapest_warping_path(a, b):
    every = [sum(abs(a[i] - b[j]) for i, j in path) for path in warping_paths(len(a), len(b))]
    assert abs(ours(a, b) - min(every)) < 1e-9


@settings(deadline=None)
@given(st.lists(st.floats(0, 3), min_size=1, max_size=16), st.lists(st.floats(0, 3), min_size=5, max_size=5))
def test_dtw_is_that_of_dtaidistance(a, b):
    reference = pytest.importorskip("dtaidistance.dtw")
    # With this inner distance it sums plain differences, without squares and roots.
    expected = reference.distance(np.array(a), np.array(b), inner_dist="euclidean", use_c=False)
    assert abs(ours(a, b, size=16) - expected) < 1e-9


def test_dtw_by_hand():
    # 1 and 1.5 both warp to 1, 2 to 2.5, 4 to 4: 0.5 + 0.5.
    assert ours([1.0, 1.5, 2.0, 4.0], [1.0, 2.5, 4.0]) == 1.0
    assert ours([2.0], [1.0, 2.5, 4.0]) == 1.0 + 0.5 + 2.0
    assert ours([1.0, 2.0, 3.0], [2.0]) == 2.0


@settings(deadline=None)
@given(numbers, templates, st.sampled_from([0.0, -1.0, 1e9, np.inf, np.nan]))
def test_padding_does_not_matter(a, b, padding):
    assert ours(a, b, padding) == ours(a, b)


@given(templates)
def test_dtw_is_zero_on_itself_and_blind_to_repetition(b):
    assert ours(b, b) == 0.0
    assert ours([b[0], *b, b[-1]], b) == 0.0


@given(templates, templates)
def test_dtw_is_symmetric_and_never_negative(a, b):
    assert ours(a, b) >= 0.0
    assert abs(ours(a, b) - ours(b, a)) < 1e-12


def test_an_empty_sequence_cannot_be_warped():
    assert ours([], [1.0, 2.0]) == np.inf


def test_single_precision_is_kept():
    cost = dtw(jnp.asarray([0.5, 1.0], jnp.float32), jnp.asarray(2), jnp.asarray([0.5, 2.0], jnp.float32))
    assert cost.dtype == jnp.float32
    assert cost == 1.0


def test_gradient_is_that_of_the_cheapest_path():
    # As in the case by hand: 1.5 lies above its partner 1, 2 below its partner 2.5.
    gradient = jax.grad(dtw)(jnp.asarray([1.0, 1.5, 2.0, 4.25]), jnp.asarray(4), jnp.asarray([1.0, 2.5, 4.0]))
    np.testing.assert_allclose(gradient[1:], [1.0, -1.0, 1.0])
