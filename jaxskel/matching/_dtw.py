"""Dynamic time warping of two short sequences (Eq. 2 and 3)."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

# Costs of a row of the matrix, and the cost W found so far.
Carry = tuple[list[Array], Array]


def dtw(a: Float[Array, " a"], length: Int[Array, ""], b: Float[Array, " b"]) -> Float[Array, ""]:
    """Matching cost W(A, B) of the first `length` elements of `a` with all of `b`, with c = |alpha - beta|.

    Handles one pair of sequences; vmap it over pairs. `a` is padded to a fixed length. Only the loop over the short `b`
    unrolls (five labels of a human): a batch runs through vector code, and with both loops unrolled (16 end nodes),
    tracing and compilation took a second more.
    """
    a, b = jnp.asarray(a), jnp.asarray(b)
    infinity = jnp.full((), jnp.inf, a.dtype)

    def next_row(carry: Carry, element: tuple[Array, Array]) -> tuple[Carry, None]:
        previous, cost = carry
        value, count = element
        row = [infinity]
        for j in range(len(b)):
            least = jnp.minimum(jnp.minimum(previous[j], previous[j + 1]), row[j])
            row.append(jnp.abs(value - b[j]) + least)
        return (row, jnp.where(length == count, row[-1], cost)), None

    begin = [jnp.zeros((), a.dtype)] + [infinity] * len(b)
    counts = jnp.arange(1, len(a) + 1, dtype=jnp.int32)
    (_, cost), _ = jax.lax.scan(next_row, (begin, jnp.where(length == 0, begin[-1], infinity)), (a, counts))
    return cost
