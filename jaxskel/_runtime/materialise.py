"""Intermediate results that are worked out once.

XLA fuses what leads to a number into every loop that uses it, and works it out again there. Where loops look numbers up
at computed places, or add up what takes long to work out, that costs several times what it saves. It does not look into
a branch that it cannot foresee.
"""

from typing import TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

T = TypeVar("T")


def computed_once(results: T, number: Float[Array, ""]) -> T:
    """The same arrays, but stored, not fused into what uses them.

    Args:
        results: A tree of arrays.
        number: Any that is not known when the function is compiled, best one that `jax.vmap` does not map over. Where
            it is NaN, and so no result can be right, all are zero.
    """
    return jax.lax.cond(number == number, lambda same: same, lambda same: jax.tree.map(jnp.zeros_like, same), results)
