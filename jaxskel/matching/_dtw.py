"""Dynamic time warping of two short sequences (Eq. 2 and 3)."""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int


def dtw(a: Float[Array, " a"], length: Int[Array, ""], b: Float[Array, " b"]) -> Float[Array, ""]:
    """Matching cost W(A, B) of the first `length` elements of `a` with all of `b`, with c = |alpha - beta|.

    Handles one pair of sequences; vmap it over pairs. `a` is padded to a fixed length. The two loops unroll: they are
    short (16 by 5 for a skeletal graph), and a batch then runs through plain vector code.
    """
    a, b = jnp.asarray(a), jnp.asarray(b)
    infinity = jnp.full((), jnp.inf, a.dtype)
    previous = [jnp.zeros((), a.dtype)] + [infinity] * len(b)
    cost = jnp.where(length == 0, previous[-1], infinity)
    for i in range(len(a)):
        row = [infinity]
        for j in range(len(b)):
            least = jnp.minimum(jnp.minimum(previous[j], previous[j + 1]), row[j])
            row.append(jnp.abs(a[i] - b[j]) + least)
        previous = row
        cost = jnp.where(length == i + 1, row[-1], cost)
    return cost
