"""Term that keeps the body inside the silhouettes."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..._runtime.materialise import computed_once
from ...body import Body
from ...outlines import SilhouetteDistances
from ._base import Observed, PlacedBody, number
from ._quadrics import PAIRS, CapsuleTerm, Quadrics, quadrics_of_samples

# Positions of the sample points along each capsule's axis.
_PLACES = np.array([1 / 6, 1 / 2, 5 / 6], np.float32)
# A ball of a limb in a table of poses stands for as many sample points.
_SAMPLES = 3.0


class InsideSilhouettes(CapsuleTerm):
    """Depths by which points on the capsules' axes come closer to an outline than `share` of their radius.

    At each point the view with the largest depth counts; if up to ``misses`` views may be wrong, that many of the
    largest depths are ignored. In addition each single view has a small weight, with a cost that saturates early, so
    that a hole in one mask adds little, but several views that agree add much.

    Attributes:
        share: Share of the radius that must be inside; below one, because clothes and poor masks take some of it.
        scale: Depth (m) beyond which a point has little weight and its cost does not grow.
        single: Weight of each single view, relative to that of the view with the largest depth.
        single_scale: Depth (m) beyond which the cost of a single view does not grow.
    """

    needs_outlines = True

    body: Body
    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    share: Float[Array, ""] = eqx.field(converter=number, default=0.7)
    scale: Float[Array, ""] = eqx.field(converter=number, default=0.06)
    single: Float[Array, ""] = eqx.field(converter=number, default=0.3)
    single_scale: Float[Array, ""] = eqx.field(converter=number, default=0.03)

    def quadrics(self, body: PlacedBody, observed: Observed) -> Quadrics:
        """Depths of the sample points, linearised and summed by capsule."""
        ends = self.ends(body)
        points = self._points(ends)
        out, gradients, weight = self.depths(points, self._radius, observed)
        rows = jnp.stack([*gradients, out])

        # A loop over views: the compiled code is eight times faster than sums over the axis of views.
        def with_view(view: Array, sums: Float[Array, "4 4 points"]) -> Float[Array, "4 4 points"]:
            own = rows[:, view]
            return computed_once(sums, self.scale) + weight[view][None, None] * own[:, None] * own[None]

        sums = jax.lax.fori_loop(0, len(out), with_view, jnp.zeros((4, 4, len(points)), points.dtype))
        pairs = jnp.stack([sums[i, j] for i, j in PAIRS])
        return quadrics_of_samples(ends, jnp.asarray(_PLACES), pairs, -sums[3, :3], sums[3, 3].sum())

    def points(
        self, body: PlacedBody
    ) -> tuple[Float[Array, "points 3"], Float[Array, " points"], Float[Array, " points"]]:
        """Sample points on the axes (m), radii there (m), and positions along the axes (0..1), in order of capsules."""
        ends = self.ends(body)
        return self._points(ends), self._radius, jnp.tile(jnp.asarray(_PLACES), len(ends))

    def depths(
        self, points: Float[Array, "points 3"], radii: Float[Array, " points"], observed: Observed
    ) -> tuple[Float[Array, "cams points"], tuple[Float[Array, "cams points"], ...], Float[Array, "cams points"]]:
        """Depth of balls in each view (m, positive outside), its gradient by their centres, and its weight."""
        silhouettes = _silhouettes(observed)
        away, gradients = silhouettes.with_gradient(points)
        out = away + self.share * radii[None]
        heard = _heard(out, jnp.asarray(silhouettes.misses))
        weight = (heard >= heard.max(0)[None]) / (1 + (out / self.scale) ** 2)
        weight = weight + self.single / (1 + (out / self.single_scale) ** 2) ** 2
        return out, gradients, jnp.where(out > 0, weight, 0.0) / len(points)

    def cost(self, body: PlacedBody, observed: Observed) -> Float[Array, ""]:
        """Robust squared depths (m^2), as a mean over the points."""
        silhouettes = _silhouettes(observed)
        away = silhouettes.at(self._points(self.ends(body)))
        return self.costs(away, self._radius, jnp.asarray(silhouettes.misses)).mean()

    def costs(
        self, away: Float[Array, "cams points"], radii: Float[Array, " points"], misses: Int[Array, ""]
    ) -> Float[Array, " points"]:
        """Robust cost (m^2) of each ball of radius `radii` (m) at signed distance `away` (m) from the silhouettes."""
        out = away + self.share * radii[None]
        decides = jnp.maximum(_heard(out, misses).max(0), 0.0)
        singles = jnp.clip(out, 0.0, self.single_scale) ** 2
        return jnp.minimum(decides, self.scale) ** 2 + self.single * singles.sum(0)

    def ball_costs(
        self, points: Float[Array, "balls 3"], radii: Float[Array, " balls"], observed: Observed
    ) -> Float[Array, " balls"]:
        """Robust squared depths (m^2), as shares of the mean over all sample points; distances are rough."""
        silhouettes = _silhouettes(observed)
        costs = self.costs(silhouettes.near(points), radii, jnp.asarray(silhouettes.misses))
        return _SAMPLES / (len(self.body.links) * len(_PLACES)) * costs

    def _points(self, ends: Float[Array, "capsules 2 3"]) -> Float[Array, "samples 3"]:
        return (ends[:, None, 0] + _PLACES[None, :, None] * (ends[:, 1] - ends[:, 0])[:, None]).reshape(-1, 3)

    @property
    def _radius(self) -> Float[Array, " samples"]:
        radii = jnp.asarray(self.body.radii)[self.body.links]
        return (radii[:, :1] + _PLACES[None] * (radii[:, 1:] - radii[:, :1])).ravel()


def _silhouettes(observed: Observed) -> SilhouetteDistances:
    assert observed.silhouettes is not None, "InsideSilhouettes needs observed.silhouettes: see silhouette_distances"
    return observed.silhouettes


def _heard(out: Float[Array, "cams points"], misses: Int[Array, ""]) -> Float[Array, "cams points"]:
    """Depths (m) with the `misses` largest of each point set to minus infinity."""

    def passed_over(_: Array, out: Array) -> Array:
        return jnp.where(out >= out.max(0)[None], -jnp.inf, out)

    # Found by value: an argmax takes far longer than a maximum, and two views are hardly ever exactly equal.
    return jax.lax.fori_loop(0, misses, passed_over, jax.lax.stop_gradient(out))
