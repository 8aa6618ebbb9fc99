"""The body lies inside the hull."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...body import Body, capsule_ends
from ._base import AbstractTerm, Observed, PlacedBody, number

# Where along each capsule's axis.
_PLACES = np.array([1 / 6, 1 / 2, 5 / 6])


class InsideHull(AbstractTerm):
    """How far points on the axes of the capsules come closer to the hull's surface than most of their radius."""

    needs_hull = True

    body: Body
    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    share: Float[Array, ""] = eqx.field(converter=number, default=0.7)
    """Share of the radius that must be inside: clothes, voxels and pruned silhouettes take some of it."""
    scale: Float[Array, ""] = eqx.field(converter=number, default=0.1)
    """Depth (m) beyond which a point that sticks out counts for little, and its cost does not grow."""

    def correspond(
        self, body: PlacedBody, observed: Observed
    ) -> tuple[
        Float[Array, "samples 3"], Float[Array, " samples"], Float[Array, "samples 3"], Float[Array, " samples"]
    ]:
        """Points on the axes, by how much they stick out, the gradient of that, and their robust weights."""
        assert observed.field is not None, "InsideHull needs observed.field: see hull_volumes"
        points = self._points(body)
        distance, gradient = jax.vmap(jax.value_and_grad(observed.field.at))(points)
        out = distance + self.share * self._radius
        return points, out, gradient, jnp.sqrt(1 / (1 + (jnp.maximum(out, 0.0) / self.scale) ** 2) / len(points))

    def residual(
        self,
        body: PlacedBody,
        observed: Observed,
        fixed: tuple[
            Float[Array, "samples 3"], Float[Array, " samples"], Float[Array, "samples 3"], Float[Array, " samples"]
        ],
    ) -> Float[Array, " samples"]:
        """Depths by which the axis points stick out (m), zero inside; their squared norm a mean over the points."""
        points, out, gradient, weight = fixed
        return weight * jnp.maximum(out + (gradient * (self._points(body) - points)).sum(-1), 0.0)

    def cost(self, body: PlacedBody, observed: Observed) -> Float[Array, ""]:
        """Squared depths (m^2) up to the scale, as a mean over the points."""
        assert observed.field is not None, "InsideHull needs observed.field: see hull_volumes"
        out = jnp.maximum(observed.field.at(self._points(body)) + self.share * self._radius, 0.0)
        return jnp.minimum(out**2, self.scale**2).mean()

    def _points(self, body: PlacedBody) -> Float[Array, "samples 3"]:
        ends = jnp.asarray(capsule_ends(self.body, body.origins, body.rotations))
        return (ends[:, None, 0] + _PLACES[None, :, None] * (ends[:, 1] - ends[:, 0])[:, None]).reshape(-1, 3)

    @property
    def _radius(self) -> Float[Array, " samples"]:
        radii = jnp.asarray(self.body.radii)[self.body.links]
        return (radii[:, :1] + _PLACES[None] * (radii[:, 1:] - radii[:, :1])).ravel()
