"""Compiled functions multiply matrices in full precision, also on devices that by default do not."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxskel._runtime.compile_cache import cached_jit
from jaxskel._runtime.precision import precise


def product(one, other):
    return one @ other


@pytest.mark.parametrize(("chosen", "told"), [(None, "HIGHEST"), ("tensorfloat32", "HIGH")])
def test_products_are_precise_unless_told_otherwise(chosen, told):
    matrix = jnp.eye(3)
    with jax.default_matmul_precision(chosen):
        text = jax.jit(precise(product)).lower(matrix, matrix).as_text()
    assert f"precision = [{told}, {told}]" in text
    assert "HIGHEST" not in jax.jit(product).lower(matrix, matrix).as_text()


def test_compiled_functions_are_precise_and_keep_their_names():
    compiled = cached_jit(product)
    assert compiled.__name__ == "product"
    matrix = np.arange(9.0, dtype=np.float32).reshape(3, 3)
    np.testing.assert_array_equal(compiled(matrix, matrix), matrix @ matrix)
    within = jax.jit(lambda one: compiled(one, one)).lower(matrix).as_text()
    assert "precision = [HIGHEST, HIGHEST]" in within
