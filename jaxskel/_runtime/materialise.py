"""Keeps XLA from computing intermediate results repeatedly.

XLA fuses the computation of a value into every loop that uses it, and repeats it there. For loops with indexed look-ups
or sums of expensive values, that costs several times what it saves. XLA does not fuse into a branch whose condition is
not known at compile time.

It also keeps XLA from writing what a loop's step computes over what the loop carries, which is slow, see `OPTIONS`.
"""

from typing import TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

T = TypeVar("T")


def computed_once(results: T, number: Float[Array, ""]) -> T:
    """Return the same arrays, but stored in memory, not fused into their uses.

    Args:
        results: A tree of arrays.
        number: Any value not known at compile time, best one that `jax.vmap` does not map over. If it is NaN, in which
            case no result can be right, all results are zero.
    """
    return jax.lax.cond(number == number, lambda same: same, lambda same: jax.tree.map(jnp.zeros_like, same), results)
