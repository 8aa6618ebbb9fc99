"""The surface of the hull is explained by the surface of the body."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...body import Body, nearest_capsule, toward_capsule
from ._base import Observed, PlacedBody, number
from ._quadrics import CapsuleTerm, Quadrics, make_quadrics


class SurfaceCoverage(CapsuleTerm):
    """Distance of each surface point of the hull to its nearest capsule of the body, robustly weighted.

    Points inside the body count less, because a visual hull is never smaller than the body but often larger.
    """

    needs_hull = True

    body: Body
    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    scale: Float[Array, ""] = eqx.field(converter=number, default=0.05)
    """Distance (m) beyond which a point counts for little (Geman-McClure)."""
    inner: Float[Array, ""] = eqx.field(converter=number, default=0.3)
    """Weight of points inside the body."""
    limit: Float[Array, ""] = eqx.field(converter=number, default=0.06)
    """Distance (m) beyond which the cost of a point does not grow."""

    def quadrics(self, body: PlacedBody, observed: Observed) -> Quadrics:
        """Nearest capsule, tangent plane and weight of each point, summed up by capsule."""
        ends, radii = self.ends(body), self._radii
        points = self._points(observed)
        which, _ = nearest_capsule(points, ends, radii)
        distance, part, normal = toward_capsule(points, ends[which], radii[which])
        weight = 1 / (1 + (distance / self.scale) ** 2) ** 2 * jnp.where(distance < 0, self.inner, 1.0) / len(points)
        return make_quadrics(ends, which, part, normal, distance, weight)

    def cost(self, body: PlacedBody, observed: Observed) -> Float[Array, ""]:
        """Squared distances (m^2) up to the limit, as a mean over the points."""
        ends = self.ends(body)
        _, distance = nearest_capsule(self._points(observed), ends, self._radii)
        weight = jnp.where(distance < 0, self.inner, 1.0)
        return (weight * jnp.minimum(distance**2, self.limit**2)).mean()

    @property
    def _radii(self) -> Float[Array, "capsules 2"]:
        return jnp.asarray(self.body.radii)[self.body.links]

    def _points(self, observed: Observed) -> Float[Array, "points 3"]:
        assert observed.surface is not None, "SurfaceCoverage needs observed.surface: see hull_volumes"
        return jnp.asarray(observed.surface)
