"""Term that attracts bones to the skeletal graph, where Pinocchio uses the medial surface (Sect. 3.3)."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ...body import SkeletonTemplate
from ._base import AbstractTerm, Observed, PlacedBody, number

# Samples on the attracted part of a bone.
_SAMPLES = 5


class GraphAttraction(AbstractTerm):
    """Samples on each attracted bone minus the closest point of its path, with a robust weight (Geman-McClure).

    Attributes:
        scale: Distance (m) beyond which a sample has little weight.
    """

    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    scale: Float[Array, ""] = eqx.field(converter=number, default=0.1)

    def correspond(
        self, body: PlacedBody, observed: Observed
    ) -> tuple[Float[Array, "bones 2 2"], Float[Array, "bones 2 3"], Float[Array, " bones"]]:
        """Closest point and robust weight of each sample, condensed for `residual`: see `_condensed`."""
        bones, tips, places = _attracted(body.template)
        ends = body.joints[bones]
        samples = (1 - places)[..., None] * ends[:, :1] + places[..., None] * ends[:, 1:]
        paths = observed.paths[tips]
        start, along = paths[:, None, :-1], (paths[:, 1:] - paths[:, :-1])[:, None]
        squared = jnp.maximum((along * along).sum(-1), 1e-12)
        part = jnp.clip(((samples[:, :, None] - start) * along).sum(-1) / squared, 0.0, 1.0)
        points = start + part[..., None] * along
        distance = ((samples[:, :, None] - points) ** 2).sum(-1)
        nearest = jnp.argmin(distance, -1)[..., None]
        closest = jnp.take_along_axis(points, nearest[..., None], 2)[:, :, 0]
        robust = 1 / (1 + jnp.take_along_axis(distance, nearest, 2)[..., 0] / self.scale**2)
        # The root makes the squared norm a mean over the samples of a bone.
        weights = robust * observed.found[tips][:, None] / np.sqrt(_SAMPLES)
        return _condensed(weights[..., None] * jnp.stack([1 - places, places], -1), weights[..., None] * closest)

    def residual(
        self,
        body: PlacedBody,
        observed: Observed,
        fixed: tuple[Float[Array, "bones 2 2"], Float[Array, "bones 2 3"], Float[Array, " bones"]],
    ) -> Float[Array, "bones 7"]:
        """Seven numbers for each bone; their norm is that of the weighted distances of its samples (m)."""
        triangle, goals, rest = fixed
        off = (triangle @ body.joints[_attracted(body.template)[0]] - goals).reshape(-1, 6)
        return jnp.concatenate([off, rest[:, None]], -1)


def _attracted(
    template: SkeletonTemplate,
) -> tuple[Int[np.ndarray, "bones 2"], Int[np.ndarray, " bones"], Float[np.ndarray, "bones samples"]]:
    """Joints at both ends of each attracted bone, the tip whose path it is on, and where on the bone samples lie."""
    # 32 bits, because JAX mixes up wider constants when float64 is switched on after the first use.
    ends, tips = (np.array([row[field] for row in template.attracted], np.int32) for field in (0, 1))
    places = np.stack([np.linspace(row.first, row.last, _SAMPLES) for row in template.attracted])
    return np.stack([template.point_parents[ends], ends], 1), tips, places.astype(np.float32)


def _condensed(
    shares: Float[Array, "bones samples 2"], goals: Float[Array, "bones samples 3"]
) -> tuple[Float[Array, "bones 2 2"], Float[Array, "bones 2 3"], Float[Array, " bones"]]:
    """A QR decomposition: ``|shares @ ends - goals|`` is ``|triangle @ ends - q^T goals|`` and a constant rest.

    The samples are linear in the bone's two ends, so any number of samples reduces to two rows.
    """
    first, second = shares[..., 0], shares[..., 1]
    length = _norm(first)
    one = first / jnp.maximum(length, 1e-12)[:, None]
    common = (one * second).sum(-1)
    across = second - common[:, None] * one
    width = _norm(across)
    two = across / jnp.maximum(width, 1e-12)[:, None]
    triangle = jnp.stack([jnp.stack([length, common], -1), jnp.stack([jnp.zeros_like(width), width], -1)], 1)
    basis = jnp.stack([one, two], 1)
    found = basis @ goals
    return triangle, found, _norm((goals - basis.swapaxes(1, 2) @ found).reshape(len(goals), -1))


def _norm(rows: Float[Array, "bones n"]) -> Float[Array, " bones"]:
    """Lengths, with a finite derivative at zero."""
    squared = (rows * rows).sum(-1)
    return jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1.0)), 0.0)
