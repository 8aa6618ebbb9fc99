"""Soft-DTW: dynamic time warping that is differentiable over all warping paths (Cuturi and Blondel, ICML 2017)."""

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

    The costs are those of [`dtw`][], with c = |alpha - beta| as in Eq. 3, so it tends to `dtw` as gamma goes to 0 and
    never exceeds it; it may be negative. It is smooth except where two elements are equal: there c has a kink, and its
    gradient is set to zero. Elements beyond ``length`` are ignored and have a gradient of zero. A ``length`` of zero
    has an infinite cost, as in `dtw`, and no gradient.

    Handles one pair of sequences; vmap it over pairs. ``a`` is padded to a fixed length.

    Args:
        a: A padded sequence (m), for a skeletal graph a row of D.
        length: Number of its elements.
        b: Another sequence (m) of at least one element.
        gamma: Smoothing (m), above zero: how much costlier paths still count.
    """
    # NaN in the padding would leak into the gradients.
    a = jnp.where(jnp.arange(len(a), dtype=jnp.int32) < length, a, 0.0)
    temperature = jnp.asarray(gamma, a.dtype)

    # Only existing predecessors: infinite costs, as in `dtw`, would give NaN gradients.
    def next_row(above: Float[Array, " b"], element: Float[Array, ""]) -> tuple[Float[Array, " b"], Float[Array, ""]]:
        row = []
        for j in range(len(b)):
            ways = [above[0]] if j == 0 else [above[j - 1], above[j], row[-1]]
            row.append(_distance(element - b[j]) + _soft_minimum(jnp.stack(ways), temperature))
        return jnp.stack(row), row[-1]

    first = jnp.cumsum(_distance(a[0] - b))
    # A scan, unlike in `dtw`: the gradient of unrolled loops takes half a minute to compile.
    _, costs = jax.lax.scan(next_row, first, a[1:])
    cost = jnp.concatenate([first[-1:], costs])[length - 1]
    return jnp.where(length == 0, jnp.inf, cost)


def _distance(difference: Float[Array, "*some"]) -> Float[Array, "*some"]:
    # At zero JAX averages the two gradients of a maximum, which gives zero; the gradient of jnp.abs is one there.
    return jnp.maximum(difference, -difference)


def _soft_minimum(costs: Float[Array, " ways"], gamma: Float[Array, ""]) -> Float[Array, ""]:
    return -gamma * jax.nn.logsumexp(-costs / gamma)
