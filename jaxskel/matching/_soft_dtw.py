"""Dynamic time warping with a gradient by all warping paths: Cuturi and Blondel, *Soft-DTW* (ICML 2017)."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int


def soft_dtw(
    a: Float[Array, " a"],
    length: Int[Array, ""],
    b: Float[Array, " b"],
    gamma: Float[Array | np.ndarray, ""] | float,
) -> Float[Array, ""]:
    """Soft minimum of the costs of all warping paths: ``-gamma log sum exp(-cost / gamma)``.

    The costs are those of [`dtw`][], with c = |alpha - beta| as in Eq. 3, so it becomes `dtw` as gamma goes to zero and
    is never above it; it may be negative. It is smooth but where an element equals its partner: there c has a kink,
    and counts as flat. What lies behind ``length`` does not matter, whatever it is, and has a gradient of zero.
    Nothing, a ``length`` of zero, has an infinite cost, as in `dtw`, and no gradient.

    Written for one pair of sequences, to be vmapped; ``a`` is padded to a fixed length.

    Args:
        a: A sequence, for a skeletal graph a row of D (m), padded.
        length: Number of its elements.
        b: Another sequence (m), one element at least.
        gamma: How much dearer paths still count (m), above zero.
    """
    # NaN in the padding would come back through the gradient of what is not used.
    a = jnp.where(jnp.arange(len(a), dtype=jnp.int32) < length, a, 0.0)
    temperature = jnp.asarray(gamma, a.dtype)

    # Only ways that there are: infinite ones, as in `dtw`, would have gradients of NaN.
    def next_row(above: Float[Array, " b"], element: Float[Array, ""]) -> tuple[Float[Array, " b"], Float[Array, ""]]:
        row = []
        for j in range(len(b)):
            ways = [above[0]] if j == 0 else [above[j - 1], above[j], row[-1]]
            row.append(_distance(element - b[j]) + _soft_minimum(jnp.stack(ways), temperature))
        return jnp.stack(row), row[-1]

    first = jnp.cumsum(_distance(a[0] - b))
    # A loop, where `dtw` unrolls: the gradient of what is unrolled takes half a minute to compile.
    _, costs = jax.lax.scan(next_row, first, a[1:])
    cost = jnp.concatenate([first[-1:], costs])[length - 1]
    return jnp.where(length == 0, jnp.inf, cost)


def _distance(difference: Float[Array, "*some"]) -> Float[Array, "*some"]:
    # Of two that are equal JAX takes the mean gradient, here zero; that of its absolute value is one there.
    return jnp.maximum(difference, -difference)


def _soft_minimum(costs: Float[Array, " ways"], gamma: Float[Array, ""]) -> Float[Array, ""]:
    return -gamma * jax.nn.logsumexp(-costs / gamma)
