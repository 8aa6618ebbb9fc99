"""Memory that JAX takes over."""

import jax
import numpy as np
import pytest

from jaxskel._runtime.taken_over import unwritten


@pytest.mark.parametrize("shape", [(3, 5), (1,), (1000,)])
def test_jax_reads_what_was_written(shape):
    array = unwritten(shape, np.int32)
    array[:] = np.arange(array.size).reshape(shape)
    assert array.ctypes.data % 64 == 0
    np.testing.assert_array_equal(jax.device_put(array), np.arange(array.size).reshape(shape))
