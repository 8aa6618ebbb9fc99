"""The surface of the hull is explained by the surface of the body."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from .._body import Body, capsule_ends
from .._capsules import all_distances, capsule_distance
from ._base import AbstractTerm, Observed, PlacedBody


class SurfaceCoverage(AbstractTerm):
    """Distance of each surface point of the hull to its nearest capsule of the body, robustly weighted.

    Points inside the body count less, because a visual hull is never smaller than the body but often larger.
    """

    body: Body
    weight: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=1.0)
    scale: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.05)
    """Distance (m) beyond which a point counts for little."""
    inner: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.3)
    """Weight of points inside the body."""

    def correspond(self, body: PlacedBody, observed: Observed) -> tuple[Int[Array, " points"], Float[Array, " points"]]:
        """Nearest capsule of each point and the point's weight."""
        assert observed.surface is not None, "SurfaceCoverage needs observed.surface: see hull_volume"
        ends = capsule_ends(self.body, body.joints, body.rotations)
        distances = all_distances(jnp.asarray(observed.surface), jnp.asarray(ends), jnp.asarray(self.body.radii))
        nearest = jnp.argmin(distances, 1).astype(jnp.int32)
        distance = jnp.take_along_axis(distances, nearest[:, None], 1)[:, 0]
        robust = 1 / (1 + (distance / self.scale) ** 2) ** 2
        return nearest, robust * jnp.where(distance < 0, self.inner, 1.0)

    def residual(self, body: PlacedBody, observed: Observed, fixed: Any) -> Float[Array, " points"]:
        """Weighted distances (m), their squared norm a mean over the points."""
        assert observed.surface is not None
        nearest, weight = fixed
        ends = jnp.asarray(capsule_ends(self.body, body.joints, body.rotations))[nearest]
        points = jnp.asarray(observed.surface)
        distance = capsule_distance(points, ends, jnp.asarray(self.body.radii)[nearest])
        return jnp.sqrt(weight / len(points)) * distance
