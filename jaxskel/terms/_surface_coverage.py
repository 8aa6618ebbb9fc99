"""The surface of the hull is explained by the surface of the body."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._body import Body, capsule_ends
from .._capsules import nearest_capsule, toward_capsule
from ._base import AbstractTerm, Observed, PlacedBody

_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
_SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]], np.int32)


class Quadrics(eqx.Module):
    """Squared distances of all surface points to the tangent planes of their capsules: a quadric for each capsule.

    However many points there are, six rows for each capsule hold all that a step of Gauss-Newton can know of them.
    """

    ends: Float[Array, "capsules 6"]
    """Where the capsules' two ends were (m)."""
    rows: Float[Array, "capsules 6 6"]
    goal: Float[Array, "capsules 6"]
    left: Float[Array, ""]
    """Root of what no displacement of the ends can take away (m)."""


class SurfaceCoverage(AbstractTerm):
    """Distance of each surface point of the hull to its nearest capsule of the body, robustly weighted.

    Points inside the body count less, because a visual hull is never smaller than the body but often larger.
    """

    body: Body
    weight: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=1.0)
    scale: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.05)
    """Distance (m) beyond which a point counts for little (Geman-McClure)."""
    inner: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.3)
    """Weight of points inside the body."""
    limit: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.06)
    """Distance (m) beyond which the cost of a point does not grow."""

    def correspond(self, body: PlacedBody, observed: Observed) -> Quadrics:
        """Nearest capsule, tangent plane and weight of each point, summed up by capsule."""
        ends, radii = jnp.asarray(capsule_ends(self.body, body.origins, body.rotations)), self._radii
        points = self._points(observed)
        which, _ = nearest_capsule(points, ends, radii)
        distance, part, normal = toward_capsule(points, ends[which], radii[which])
        weight = 1 / (1 + (distance / self.scale) ** 2) ** 2 * jnp.where(distance < 0, self.inner, 1.0) / len(points)
        # Moving the ends by (a, b) shortens the distance by (1 - part) normal . a + part normal . b.
        shares = jnp.stack([(1 - part) ** 2, part * (1 - part), part**2])
        pairs = jnp.stack([normal[:, i] * normal[:, j] for i, j in _PAIRS])
        columns = (shares[:, None] * pairs[None]).reshape(18, -1)
        vector = (distance[None] * jnp.stack([1 - part, part]))[:, None] * normal.T[None]
        columns = jnp.concatenate([columns, vector.reshape(6, -1)]) * weight[None]
        member = (which[None] == jnp.arange(len(ends), dtype=jnp.int32)[:, None]).astype(columns.dtype)
        sums = jnp.einsum("cp,kp->ck", member, columns)
        blocks = sums[:, :18].reshape(-1, 3, 6)[:, :, _SYMMETRIC]  # capsules x shares x 3 x 3
        first, mixed, last = blocks[:, 0], blocks[:, 1], blocks[:, 2]
        matrix = jnp.concatenate(
            [jnp.concatenate([first, mixed], 2), jnp.concatenate([mixed, last], 2)], 1
        )  # fmt: skip
        vector = sums[:, 18:]
        # A capsule's twist, and what no point lies on, are seen by nothing.
        lower = jnp.linalg.cholesky(matrix + 1e-6 * jnp.eye(6)[None])
        goal = jax.vmap(lambda a, b: jax.scipy.linalg.solve_triangular(a, b, lower=True))(lower, vector)
        left = jnp.maximum((weight * distance**2).sum() - (goal**2).sum(), 0.0)
        return Quadrics(ends.reshape(-1, 6), lower.swapaxes(1, 2), goal, jnp.sqrt(left + 1e-12))

    def residual(self, body: PlacedBody, observed: Observed, fixed: Quadrics) -> Float[Array, " rows"]:
        """Weighted distances (m) to the tangent planes; their squared norm is a mean over the points."""
        ends = jnp.asarray(capsule_ends(self.body, body.origins, body.rotations)).reshape(-1, 6)
        rows = jnp.einsum("cij,cj->ci", fixed.rows, ends - fixed.ends) - fixed.goal
        return jnp.append(rows.ravel(), fixed.left)

    def cost(self, body: PlacedBody, observed: Observed) -> Float[Array, ""]:
        """Squared distances (m^2) up to the limit, as a mean over the points."""
        ends = jnp.asarray(capsule_ends(self.body, body.origins, body.rotations))
        _, distance = nearest_capsule(self._points(observed), ends, self._radii)
        weight = jnp.where(distance < 0, self.inner, 1.0)
        return (weight * jnp.minimum(distance**2, self.limit**2)).mean()

    @property
    def _radii(self) -> Float[Array, "capsules 2"]:
        return jnp.asarray(self.body.radii)[self.body.links]

    def _points(self, observed: Observed) -> Float[Array, "points 3"]:
        assert observed.surface is not None, "SurfaceCoverage needs observed.surface: see hull_volume"
        return jnp.asarray(observed.surface)
