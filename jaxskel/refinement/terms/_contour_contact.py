"""Term that makes the outlines of the silhouettes outlines of the body."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...body import Body, Grazed, nearest_to_rays
from ._base import Observed, PlacedBody, number
from ._losses import AbstractLoss
from ._quadrics import CapsuleTerm, Quadrics, make_quadrics


class ContourContact(CapsuleTerm):
    """Distance of each viewing ray through a silhouette's outline to the nearest capsule of the body.

    With few views most of the visual hull's surface is not the body's, but every outline ray touches the body. So
    parts of the hull that no view can carve away cost nothing here.

    Attributes:
        scale: Distance (m) beyond which a ray has little weight (Geman-McClure).
        inner: Weight of rays that pass through the body, relative to those outside it.
        limit: Distance (m) beyond which the cost of a ray does not grow.
        loss: Another loss, of the distance in units of `scale`, in place of Geman-McClure and `limit`.
    """

    needs_outlines = True

    body: Body
    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    scale: Float[Array, ""] = eqx.field(converter=number, default=0.05)
    inner: Float[Array, ""] = eqx.field(converter=number, default=0.3)
    limit: Float[Array, ""] = eqx.field(converter=number, default=0.06)
    loss: AbstractLoss | None = None

    def quadrics(self, body: PlacedBody, observed: Observed) -> Quadrics:
        """Nearest capsule, tangent plane and weight of each ray, summed by capsule."""
        ends, near = self._nearest(body, observed)
        weight = self._weight(near)
        return make_quadrics(ends, near.capsule, near.part, near.normal, near.distance, weight)

    def nearest(self, body: PlacedBody, observed: Observed) -> tuple[Grazed, Float[Array, " rays"]]:
        """Nearest capsule of each ray, and the weight of its squared distance."""
        _, near = self._nearest(body, observed)
        return near, self._weight(near)

    def cost(self, body: PlacedBody, observed: Observed) -> Float[Array, ""]:
        """Squared distances (m^2), constant beyond `limit`, or their robust cost, as a mean over the rays."""
        distance = self._nearest(body, observed)[1].distance
        if self.loss is None:
            cost = jnp.minimum(distance**2, self.limit**2)
        else:
            cost = self.scale**2 * self.loss.cost((distance / self.scale) ** 2)
        return (jnp.where(distance < 0, self.inner, 1.0) * cost).mean()

    def at_scale(self, scale: Float[Array, ""]) -> "ContourContact":
        """The same term with another `scale`."""
        return replace(self, scale=scale)

    def ray_costs(self, distance: Float[Array, "*rays"], observed: Observed) -> Float[Array, "*rays"]:
        """Squared distances (m^2), constant beyond `limit`, as shares of the mean over all rays."""
        assert observed.contours is not None
        return jnp.minimum(distance, self.limit) ** 2 / len(observed.contours.centres)

    def _weight(self, near: Grazed) -> Float[Array, " rays"]:
        squared = (near.distance / self.scale) ** 2
        robust = 1 / (1 + squared) ** 2 if self.loss is None else self.loss.weight(squared)
        weight = robust * jnp.where(near.distance < 0, self.inner, 1.0)
        return weight / len(weight)

    def _nearest(self, body: PlacedBody, observed: Observed) -> tuple[Float[Array, "capsules 2 3"], Grazed]:
        assert observed.contours is not None, "ContourContact needs observed.contours: see contours"
        ends = self.ends(body)
        radii = jnp.asarray(self.body.radii)[self.body.links]
        centres, directions = jnp.asarray(observed.contours.centres), jnp.asarray(observed.contours.directions)
        return ends, nearest_to_rays(centres, directions, ends, radii)
