"""The body lies inside the silhouettes."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._body import Body, capsule_ends
from ._base import AbstractTerm, Observed, PlacedBody
from ._quadrics import PAIRS, Quadrics, quadrics_of_samples

# Where along each capsule's axis.
_PLACES = np.array([1 / 6, 1 / 2, 5 / 6], np.float32)


class InsideSilhouettes(AbstractTerm):
    """How far points on the axes of the capsules come closer to a silhouette's outline than most of their radius.

    At each point the view that objects most decides; where views may err, as many are passed over as may. Besides,
    each view has a small say of its own that a hole in its mask soon exhausts: several together are hardly wrong.
    """

    body: Body
    weight: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=1.0)
    share: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.7)
    """Share of the radius that must be inside: clothes and poor masks take some of it."""
    scale: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.06)
    """Depth (m) beyond which a point that sticks out counts for little, and its cost does not grow."""
    single: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.3)
    """Weight of each single view, relative to that of the one that decides."""
    single_scale: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.03)
    """`scale` for single views."""

    def correspond(self, body: PlacedBody, observed: Observed) -> Quadrics:
        """Depths by which the points stick out, linearised and summed up by capsule."""
        ends = jnp.asarray(capsule_ends(self.body, body.origins, body.rotations))
        points = self._points(ends)
        out, change = jax.linearize(lambda points: self._depths(points, self._radius, observed), points)
        gradients = jax.vmap(lambda axis: change(jnp.broadcast_to(axis, points.shape)), out_axes=-1)(jnp.eye(3))
        decides = jnp.arange(len(out), dtype=jnp.int32)[:, None] == _deciding(out, observed)[None]
        weight = decides / (1 + (out / self.scale) ** 2) + self.single / (1 + (out / self.single_scale) ** 2) ** 2
        weight = jnp.where(out > 0, weight, 0.0) / len(points)
        pairs = jnp.stack([(weight * gradients[..., i] * gradients[..., j]).sum(0) for i, j in PAIRS])
        vector = -(weight * out)[..., None] * gradients
        return quadrics_of_samples(ends, jnp.asarray(_PLACES), pairs, vector.sum(0).T, (weight * out**2).sum())

    def residual(self, body: PlacedBody, observed: Observed, fixed: Quadrics) -> Float[Array, " rows"]:
        """Weighted depths (m); their squared norm is a mean over the points."""
        return fixed.residual(jnp.asarray(capsule_ends(self.body, body.origins, body.rotations)))

    def cost(self, body: PlacedBody, observed: Observed) -> Float[Array, ""]:
        """Squared depths (m^2) up to the scales, as a mean over the points."""
        ends = jnp.asarray(capsule_ends(self.body, body.origins, body.rotations))
        return self.costs(self._points(ends), self._radius, observed).mean()

    def costs(
        self, points: Float[Array, "points 3"], radii: Float[Array, " points"], observed: Observed
    ) -> Float[Array, " points"]:
        """What balls of some radii at some points cost by themselves (m^2)."""
        out = jnp.maximum(self._depths(points, radii, observed), 0.0)
        decides = jnp.take_along_axis(out, _deciding(out, observed)[None], 0)[0]
        singles = jnp.minimum(out**2, self.single_scale**2).sum(0)
        return jnp.minimum(decides**2, self.scale**2) + self.single * singles

    def _depths(
        self, points: Float[Array, "points 3"], radii: Float[Array, " points"], observed: Observed
    ) -> Float[Array, "cams points"]:
        """By how much balls of some radii stick out of each silhouette (m), negative inside."""
        assert observed.silhouettes is not None, "InsideSilhouettes needs observed.silhouettes"
        return observed.silhouettes.at(points) + self.share * radii[None]

    def _points(self, ends: Float[Array, "capsules 2 3"]) -> Float[Array, "samples 3"]:
        return (ends[:, None, 0] + _PLACES[None, :, None] * (ends[:, 1] - ends[:, 0])[:, None]).reshape(-1, 3)

    @property
    def _radius(self) -> Float[Array, " samples"]:
        radii = jnp.asarray(self.body.radii)[self.body.links]
        return (radii[:, :1] + _PLACES[None] * (radii[:, 1:] - radii[:, :1])).ravel()


def _deciding(out: Float[Array, "cams points"], observed: Observed) -> Int[Array, " points"]:
    """The view that objects most to each point, after those that may err."""
    assert observed.silhouettes is not None
    views = jnp.arange(len(out), dtype=jnp.int32)[:, None]

    def passed_over(_: Array, out: Array) -> Array:
        return jnp.where(views == jnp.argmax(out, 0)[None], -jnp.inf, out)

    out = jax.lax.fori_loop(0, observed.silhouettes.misses, passed_over, jax.lax.stop_gradient(out))
    return jnp.argmax(out, 0)
