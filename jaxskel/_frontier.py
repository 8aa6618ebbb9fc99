"""How far rays through outlines run inside a hull, and what they miss it by: noise, and a depth that is never negative.

The residual of a true ray is noise minus a depth. Most rays run just along the hull of the other views, some deep
through it, and where a mask is wrong a residual is anything. Econometrics calls this a stochastic frontier: D. Aigner,
C. Lovell, P. Schmidt: Formulation and estimation of stochastic frontier production function models, J. Econometrics 6
(1977), here with a mixture of exponential depths.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import log_ndtr
from jaxtyping import Array, Float, Int

from ._camera_step import Pull
from ._kept import kept

# Mean depths (px) that the mixture is made of, from a tenth of what a pixel tells to the width of a trunk.
_DEPTHS = np.geomspace(0.1, 30.0, 6)
# Residuals of wrong masks are anywhere on so many pixels.
_ANYWHERE = 60.0
# Noise (px) that even the outlines of clean masks have, from their pixels.
_LEAST_NOISE = 0.1
_ROUNDS = 40
# A hull is tight where its mean depth is less than so many standard deviations of noise.
_TIGHT = 3.0
# Residuals are told apart to this (px).
_BIN = 0.02


class Frontier(eqx.Module):
    """The distribution of the residuals of rays."""

    noise: Float[Array | np.ndarray, ""]
    """Standard deviation (px)."""
    shares: Float[Array | np.ndarray, "kinds=7"]
    """Of rays of each mean depth, and last of those that are wrong."""

    @property
    def tight(self) -> bool:
        """The hull is hardly wider than noise: depths are alike then, whatever the rig."""
        shares = np.asarray(self.shares[:-1])
        return bool(shares @ _DEPTHS < _TIGHT * self.noise * shares.sum())

    def pull(self, residuals: Float[Array, " rays"]) -> Pull:
        """Of the density's logarithm; what kind a ray is is held, so that the curvature is never negative."""
        posterior, alpha, hazard = _posterior(self, residuals)
        slope = posterior[:-1] * (1 / jnp.asarray(_DEPTHS)[:, None] - hazard / self.noise)
        return Pull(slope.sum(0), (posterior[:-1] * hazard * (hazard + alpha)).sum(0) / self.noise**2)


def fit_frontier(residuals: Float[Array | np.ndarray, " rays"]) -> Frontier:
    """Noise and depths that explain some residuals (px) best (expectation maximisation)."""
    half = _ANYWHERE / 2
    edges = np.linspace(-half, half, round(_ANYWHERE / _BIN) + 1)
    count, _ = np.histogram(np.clip(np.asarray(residuals), -half, half), edges)
    with jax.enable_x64(True):
        return jax.tree.map(np.asarray, _fitted((edges[1:] + edges[:-1]) / 2, count.astype(np.float64)))


@kept
def _fitted(values: Float[Array | np.ndarray, " bins"], count: Float[Array | np.ndarray, " bins"]) -> Frontier:
    total = jnp.maximum(count.sum(), 1)

    def better(_: Int[Array, ""], frontier: Frontier) -> Frontier:
        posterior, alpha, hazard = _posterior(frontier, values)
        weight = posterior * jnp.asarray(count)[None]
        # The depth of a ray is normal but cut off at zero, given its residual and its kind.
        noise = frontier.noise
        off = jnp.asarray(values)[None] + noise * (alpha + hazard)
        square = off**2 + noise**2 * (1 - hazard * (hazard + alpha))
        variance = (weight[:-1] * square).sum() / jnp.maximum(weight[:-1].sum(), 1)
        # One ray of each kind besides: none dies out.
        shares = (weight.sum(1) + 1) / (total + len(weight))
        return Frontier(jnp.sqrt(jnp.maximum(variance, _LEAST_NOISE**2)), shares)

    kinds = len(_DEPTHS) + 1
    return jax.lax.fori_loop(0, _ROUNDS, better, Frontier(jnp.ones(()), jnp.full(kinds, 1 / kinds)))


def _posterior(
    frontier: Frontier, residuals: Float[Array | np.ndarray, " rays"]
) -> tuple[Float[Array, "kinds=7 rays"], Float[Array, "depths=6 rays"], Float[Array, "depths=6 rays"]]:
    """How probably each ray is of each kind; where its depth's normal distribution is cut off, and the hazard there."""
    depths, noise = jnp.asarray(_DEPTHS)[:, None], frontier.noise
    residuals = jnp.asarray(residuals)[None]
    alpha = -(residuals / noise + noise / depths)
    below = log_ndtr(alpha)
    density = residuals / depths + (noise / depths) ** 2 / 2 - jnp.log(depths) + below
    anywhere = jnp.full_like(residuals, -np.log(_ANYWHERE))
    logits = jnp.concatenate([density, anywhere]) + jnp.log(frontier.shares)[:, None]
    hazard = jnp.exp(-(alpha**2) / 2 - np.log(2 * np.pi) / 2 - below)
    return jax.nn.softmax(logits, 0), alpha, hazard
