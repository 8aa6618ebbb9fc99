"""The body lies inside the silhouettes."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._body import Body, capsule_ends
from ._base import AbstractTerm, Observed, PlacedBody
from ._quadrics import Quadrics, make_quadrics

# Where along each capsule's axis.
_PLACES = np.array([1 / 6, 1 / 2, 5 / 6], np.float32)


class InsideSilhouettes(AbstractTerm):
    """How far points on the axes of the capsules come closer to a silhouette's outline than most of their radius.

    The view that objects most decides, unless some views may err: then so many are left out, anew for each point.
    """

    body: Body
    weight: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=1.0)
    share: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.7)
    """Share of the radius that must be inside: clothes and poor masks take some of it."""
    scale: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.1)
    """Depth (m) beyond which a point that sticks out counts for little, and its cost does not grow."""

    def correspond(self, body: PlacedBody, observed: Observed) -> Quadrics:
        """Depths by which the points stick out, linearised and summed up by capsule."""
        ends = jnp.asarray(capsule_ends(self.body, body.origins, body.rotations))
        points = self._points(ends)
        out, change = jax.linearize(lambda points: self.sticking_out(points, self._radius, observed), points)
        weight = (out > 0) / (1 + (out / self.scale) ** 2) / len(points)
        gradients = jax.vmap(lambda axis: change(jnp.broadcast_to(axis, points.shape)), out_axes=-1)(jnp.eye(3))
        capsules = jnp.repeat(jnp.arange(len(ends), dtype=jnp.int32), len(_PLACES))
        part = jnp.tile(jnp.asarray(_PLACES), len(ends))
        return make_quadrics(ends, capsules, part, -gradients, out, weight)

    def residual(self, body: PlacedBody, observed: Observed, fixed: Quadrics) -> Float[Array, " rows"]:
        """Weighted depths (m); their squared norm is a mean over the points."""
        return fixed.residual(jnp.asarray(capsule_ends(self.body, body.origins, body.rotations)))

    def cost(self, body: PlacedBody, observed: Observed) -> Float[Array, ""]:
        """Squared depths (m^2) up to the limit, as a mean over the points."""
        ends = jnp.asarray(capsule_ends(self.body, body.origins, body.rotations))
        out = jnp.maximum(self.sticking_out(self._points(ends), self._radius, observed), 0.0)
        return jnp.minimum(out**2, self.scale**2).mean()

    def sticking_out(
        self, points: Float[Array, "points 3"], radii: Float[Array, " points"], observed: Observed
    ) -> Float[Array, " points"]:
        """By how much balls of some radii stick out of the silhouettes (m), negative inside."""
        assert observed.silhouettes is not None, "InsideSilhouettes needs observed.silhouettes"
        distances = observed.silhouettes.at(points)
        views = jnp.arange(len(distances), dtype=jnp.int32)[:, None]
        for _ in range(observed.silhouettes.misses):
            distances = jnp.where(views == jnp.argmax(distances, 0)[None], -1.0, distances)
        # Not a maximum: where views are level, its derivative is none of theirs.
        decides = jnp.argmax(distances, 0)[None]
        return jnp.take_along_axis(distances, decides, 0)[0] + self.share * radii

    def _points(self, ends: Float[Array, "capsules 2 3"]) -> Float[Array, "samples 3"]:
        return (ends[:, None, 0] + _PLACES[None, :, None] * (ends[:, 1] - ends[:, 0])[:, None]).reshape(-1, 3)

    @property
    def _radius(self) -> Float[Array, " samples"]:
        radii = jnp.asarray(self.body.radii)[self.body.links]
        return (radii[:, :1] + _PLACES[None] * (radii[:, 1:] - radii[:, :1])).ravel()
