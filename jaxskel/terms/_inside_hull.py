"""The body lies inside the hull."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._body import Body, capsule_ends
from ._base import AbstractTerm, Observed, PlacedBody

# Where along each capsule's axis.
_PLACES = np.array([0.0, 0.5])


class InsideHull(AbstractTerm):
    """How far points on the axes of the capsules come closer to the hull's surface than most of their radius."""

    body: Body
    weight: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=1.0)
    share: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.7)
    """Share of the radius that must be inside: clothes, voxels and pruned silhouettes take some of it."""

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "capsules places=2"]:
        """Depths by which the axis points stick out (m), zero inside; their squared norm a mean over the points."""
        assert observed.field is not None, "InsideHull needs observed.field: see hull_volume"
        ends = jnp.asarray(capsule_ends(self.body, body.joints, body.rotations))
        radii = jnp.asarray(self.body.radii)
        start, along = ends[:, None, 0], (ends[:, 1] - ends[:, 0])[:, None]
        points = start + _PLACES[None, :, None] * along
        radius = radii[:, :1] + _PLACES[None] * (radii[:, 1:] - radii[:, :1])
        out = observed.field.at(points) + self.share * radius
        return jnp.maximum(out, 0.0) / np.sqrt(2 * len(radii))
