"""Robust losses: functions rho of a squared residual s that grow more slowly than s beyond a scale.

P. J. Huber: Robust Estimation of a Location Parameter (1964); S. Geman and D. McClure: Statistical Methods for
Tomographic Image Reconstruction (1987). All are about s for small residuals and concave in s.
"""

from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._runtime.kinds import check_number
from ._base import number

# Squared residuals below this share of the squared scale: there, log(1 + u) / u is computed by its series.
_SMALL = 1e-3


def _scale(value: Any) -> Float[Array, ""]:
    if isinstance(value, jax.Array | np.ndarray):
        return number(value)
    check_number("scale", value, 1e-12, 1e12, "a positive number")
    return jnp.asarray(value, jnp.result_type(float))


class AbstractLoss(eqx.Module):
    """A robust loss. One of your own defines `ratio`; it must be smooth, and concave as a cost of the square.

    Attributes:
        scale: Length of a residual, in its own unit, beyond which it counts less.
    """

    scale: eqx.AbstractVar[Float[Array, ""]]

    @abstractmethod
    def ratio(self, squared: Float[Array, " n"]) -> Float[Array, " n"]:
        """The cost divided by the squared residual, rho(s) / s; one at s = 0."""

    def cost(self, squared: Float[Array, " n"]) -> Float[Array, " n"]:
        """The cost rho(s) of squared residuals s."""
        return squared * self.ratio(squared)

    def weight(self, squared: Float[Array, " n"]) -> Float[Array, " n"]:
        """The derivative of the cost by s: the weight of a residual in iteratively re-weighted least squares."""
        return jax.jvp(self.cost, (squared,), (jnp.ones_like(squared),))[1]

    def split(self, squared: Float[Array, " n"]) -> tuple[Float[Array, " n"], Float[Array, " n"] | None]:
        """A factor a of the residual, and one more residual b or none, with a^2 s + b^2 = rho(s)."""
        return jnp.sqrt(self.ratio(squared)), None


class Huber(AbstractLoss):
    """Squares up to `scale`, then lengths: an outlier pulls as strongly as a residual of `scale`."""

    scale: Float[Array, ""] = eqx.field(converter=_scale)

    def ratio(self, squared: Float[Array, " n"]) -> Float[Array, " n"]:
        """The cost divided by the squared residual; the cost is s up to k^2, then 2 k sqrt(s) - k^2."""
        beyond = jnp.maximum(squared / self.scale**2, 1.0)
        return (2 * jnp.sqrt(beyond) - 1) / beyond


class Cauchy(AbstractLoss):
    """k^2 log(1 + s / k^2): the pull of an outlier falls with its length, slowly."""

    scale: Float[Array, ""] = eqx.field(converter=_scale)

    def ratio(self, squared: Float[Array, " n"]) -> Float[Array, " n"]:
        """The cost divided by the squared residual."""
        share = squared / self.scale**2
        small = share < _SMALL
        near, far = jnp.where(small, share, 0.0), jnp.where(small, 1.0, share)
        return jnp.where(small, 1 - near / 2 + near**2 / 3 - near**3 / 4, jnp.log1p(far) / far)


class GemanMcClure(AbstractLoss):
    """s / (1 + s / k^2): an outlier costs at most k^2 and hardly pulls."""

    scale: Float[Array, ""] = eqx.field(converter=_scale)

    def ratio(self, squared: Float[Array, " n"]) -> Float[Array, " n"]:
        """The cost divided by the squared residual."""
        return 1 / (1 + squared / self.scale**2)

    def split(self, squared: Float[Array, " n"]) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
        """A factor 1 / (1 + s / k^2) and one more residual (s / k) / (1 + s / k^2).

        With both, the Gauss-Newton matrix is that of re-weighted least squares exactly. The root of the cost alone is
        so flat that a Gauss-Newton step would lead 1 + s / k^2 times too far.
        """
        factor = 1 / (1 + squared / self.scale**2)
        return factor, factor * squared / self.scale


def robust_rows(loss: AbstractLoss, vectors: Float[Array, "n group"]) -> Float[Array, "n rows"]:
    """Residuals whose squared norm is the robust cost of each vector; some losses have one row more.

    The rows depend on the vectors as the cost does, with nothing held fixed. So the cost is right for any solver, least
    squares or BFGS, within one solve, and gradients reach the scale.
    """
    factor, more = loss.split((vectors**2).sum(-1))
    rows = factor[:, None] * vectors
    return rows if more is None else jnp.concatenate([rows, more[:, None]], 1)
