"""Squared distances between a body and its observations, linearised in the capsules' ends and radii."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..body import LINKS
from ..refinement.terms import ContourContact, InsideSilhouettes, Observed, PlacedBody


class ShapeQuadrics(eqx.Module):
    """Weighted squared distances of one frame, summed by capsule.

    Displacing the two ends of a capsule by (a, b) and enlarging its radii by (r, s) changes its cost by
    d . matrix d - 2 vector . d, with d = (a, b, r, s).

    Attributes:
        squared: Weighted sum of the squared distances at the linearisation (m^2).
    """

    matrix: Float[Array, "capsules 8 8"]
    vector: Float[Array, "capsules 8"]
    squared: Float[Array, ""]

    def __add__(self, other: "ShapeQuadrics") -> "ShapeQuadrics":
        return ShapeQuadrics(self.matrix + other.matrix, self.vector + other.vector, self.squared + other.squared)


def may_err(observed: Observed) -> Bool[Array, ""]:
    """Whether masks are so poor that some views may err, see `judge_misses`."""
    assert observed.silhouettes is not None
    return jnp.asarray(observed.silhouettes.misses) > 0


def contour_quadrics(term: ContourContact, placed: PlacedBody, observed: Observed) -> ShapeQuadrics:
    """Squared distances of outline rays to their nearest capsules, see `ContourContact`."""
    near, weight = term.nearest(placed, observed)
    weight = term.weight * weight
    part = near.part[:, None]
    # Moving the surface towards the ray shortens the distance.
    rows = jnp.concatenate([(1 - part) * near.normal, part * near.normal, 1 - part, part], 1)
    member = (near.capsule[None] == jnp.arange(len(LINKS), dtype=jnp.int32)[:, None]).astype(rows.dtype)
    squares = (rows[:, :, None] * rows[:, None] * weight[:, None, None]).reshape(len(rows), -1)
    vector = member @ (rows * (weight * near.distance)[:, None])
    return ShapeQuadrics((member @ squares).reshape(-1, 8, 8), vector, (weight * near.distance**2).sum())


def inside_quadrics(term: InsideSilhouettes, placed: PlacedBody, observed: Observed) -> ShapeQuadrics:
    """Squared depths by which points on the axes stick out of the silhouettes, see `InsideSilhouettes`.

    Where views may err, depths move the body, but do not make it thinner: holes lie inside the person in every frame.
    """
    points, radii, part = term.points(placed)
    out, gradients, weight = term.depths(points, radii, observed)
    weight = term.weight * weight
    away = jnp.stack(gradients, -1)
    part = jnp.broadcast_to(part[None, :, None], (*out.shape, 1))
    thinner = jnp.where(may_err(observed), 0.0, term.share)
    rows = [(1 - part) * away, part * away, thinner * (1 - part), thinner * part]
    shape = len(out), len(LINKS), -1
    rows = -jnp.concatenate(rows, -1).reshape(*shape, 8)
    weight, out = weight.reshape(shape), out.reshape(shape)
    matrix = jnp.einsum("vcpi,vcpj,vcp->cij", rows, rows, weight)
    return ShapeQuadrics(matrix, jnp.einsum("vcpi,vcp->ci", rows, weight * out), (weight * out**2).sum())
