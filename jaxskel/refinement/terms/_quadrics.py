"""Squared distances between capsules and their target points, summed to one quadratic form for each capsule."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ...body import Body, capsule_ends
from ._base import AbstractTerm, Observed, PlacedBody

PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Index pairs of the six components of a symmetric 3 x 3 matrix."""
_SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]], np.int32)


class Quadrics(eqx.Module):
    """Weighted squared distances, linearised in the ends of the capsules, as needed for a Gauss-Newton step.

    For any number of points, a displacement d of a capsule's ends changes their cost by d . matrix d - 2 vector . d.

    Attributes:
        ends: Ends of the capsules at the linearisation (m).
        squared: Weighted sum of the squared distances at the linearisation (m^2).
    """

    ends: Float[Array, "capsules 6"]
    matrix: Float[Array, "capsules 6 6"]
    vector: Float[Array, "capsules 6"]
    squared: Float[Array, ""]

    def rows(self) -> "QuadricRows":
        """Write the quadratic forms as rows of a least squares problem."""
        # The 1e-6 makes matrices definite: a capsule's twist, and a capsule without points, are unconstrained.
        lower, goal = _factored(self.matrix + 1e-6 * jnp.eye(6)[None], self.vector)
        left = jnp.maximum(self.squared - (goal**2).sum(), 0.0)
        return QuadricRows(self.ends, lower.swapaxes(1, 2), goal, jnp.sqrt(left + 1e-12))


class QuadricRows(eqx.Module):
    """The quadratic forms of `Quadrics` as six rows for each capsule.

    Attributes:
        ends: Ends of the capsules at the linearisation (m).
        left: Root of the cost that remains at the best displacement of the ends (m).
    """

    ends: Float[Array, "capsules 6"]
    rows: Float[Array, "capsules 6 6"]
    goal: Float[Array, "capsules 6"]
    left: Float[Array, ""]

    def residual(self, ends: Float[Array, "capsules 2 3"]) -> Float[Array, " rows"]:
        """Residual (m) at other ends; its squared norm is the weighted sum of the squared distances."""
        rows = jnp.einsum("cij,cj->ci", self.rows, ends.reshape(-1, 6) - self.ends) - self.goal
        return jnp.append(rows.ravel(), self.left)


class CapsuleTerm(AbstractTerm):
    """A term that attracts the capsules of a body to target points, or repels them.

    A subclass defines `quadrics`. Residuals follow from them; a Gauss-Newton step uses them directly, at less cost.
    """

    needs_graph = False

    body: eqx.AbstractVar[Body]

    def quadrics(self, body: PlacedBody, observed: Observed) -> Quadrics:
        """Distances at a pose (m), linearised and summed by capsule."""
        raise NotImplementedError

    def ends(self, body: PlacedBody) -> Float[Array, "capsules 2 3"]:
        """Both ends of each capsule (m, in the world)."""
        return jnp.asarray(capsule_ends(self.body, body.origins, body.rotations))

    def correspond(self, body: PlacedBody, observed: Observed) -> QuadricRows:
        """What stays fixed during an inner solve: nearest points, normals and weights, in the form of rows."""
        return self.quadrics(body, observed).rows()

    def residual(self, body: PlacedBody, observed: Observed, fixed: QuadricRows) -> Float[Array, " rows"]:
        """Weighted linearised distances (m); their squared norm is a mean over the points."""
        return fixed.residual(self.ends(body))


def make_quadrics(
    ends: Float[Array, "capsules 2 3"],
    which: Int[Array, " points"],
    part: Float[Array, " points"],
    normal: Float[Array, "points 3"],
    distance: Float[Array, " points"],
    weight: Float[Array, " points"],
) -> Quadrics:
    """Sum the linearised squared distances by capsule.

    Args:
        ends: Ends of the capsules (m).
        which: Capsule of each point.
        part: Position along the capsule's axis (0..1).
        normal: Unit vector from there to the point: moving the ends by (a, b) shortens the distance by
            (1 - part) normal . a + part normal . b.
        distance: Signed distance from the capsule's surface (m).
        weight: Weight of the squared distance.
    """
    shares = jnp.stack([1 - part, part], -1)
    normals = (shares[:, :, None] * normal[:, None]).reshape(-1, 6)
    weighted = weight[:, None] * normals

    # Rows are added by index: a product with a matrix of ones and zeros takes twice as long.
    def added(rows: Float[Array, "points ..."]) -> Float[Array, "capsules ..."]:
        return jnp.zeros((len(ends), *rows.shape[1:]), rows.dtype).at[which].add(rows, mode="promise_in_bounds")

    matrix = added(weighted[:, :, None] * normals[:, None])
    vector, squared = added(distance[:, None] * weighted), (weight * distance**2).sum()
    return Quadrics(ends.reshape(-1, 6), matrix, vector, squared)


def quadrics_of_samples(
    ends: Float[Array, "capsules 2 3"],
    part: Float[Array, " places"],
    pairs: Float[Array, "6 samples"],
    vector: Float[Array, "3 samples"],
    squared: Float[Array, ""],
) -> Quadrics:
    """Sum the quadratic forms of samples that lie at the same positions along each capsule.

    Args:
        ends: Ends of the capsules (m).
        part: Positions along each axis (0..1); samples are ordered by capsule, then by position.
        pairs: Weighted products of the normal's components with each other, in the order of `PAIRS`.
        vector: Weighted products of the distance (m) with the normal, which points from the capsule to the goal.
        squared: Weighted sum of the squared distances (m^2).
    """
    along = jnp.tile(part, len(ends))
    rows = jnp.concatenate([_spread(pairs, _squares(along)), _spread(vector, _linear(along))])
    return _from_sums(ends, rows.reshape(len(rows), len(ends), len(part)).sum(2).T, squared)


def _factored(
    matrix: Float[Array, "capsules 6 6"], vector: Float[Array, "capsules 6"]
) -> tuple[Float[Array, "capsules 6 6"], Float[Array, "capsules 6"]]:
    """Cholesky factors L of the matrices, and L^-1 times the vectors.

    Column by column for all capsules at once: LAPACK, called for each matrix separately, takes as long as half the
    search for the nearest capsules.
    """
    rest, columns = jnp.concatenate([matrix, vector[:, None]], 1), []
    for size in range(6, 0, -1):
        column = rest[:, :, 0] / jnp.sqrt(rest[:, :1, 0])
        columns.append(jnp.pad(column, ((0, 0), (6 - size, 0))))
        rest = rest[:, 1:, 1:] - column[:, 1:, None] * column[:, None, 1:size]
    factors = jnp.stack(columns, -1)
    return factors[:, :6], factors[:, 6]


def _squares(part: Float[Array, " n"]) -> Float[Array, "3 n"]:
    return jnp.stack([(1 - part) ** 2, part * (1 - part), part**2])


def _linear(part: Float[Array, " n"]) -> Float[Array, "2 n"]:
    return jnp.stack([1 - part, part])


def _spread(numbers: Float[Array, "k n"], shares: Float[Array, "s n"]) -> Float[Array, "s*k n"]:
    """Distribute each sample's numbers over the two ends of its capsule."""
    return (shares[:, None] * numbers[None]).reshape(-1, numbers.shape[1])


def _from_sums(
    ends: Float[Array, "capsules 2 3"], sums: Float[Array, "capsules 24"], squared: Float[Array, ""]
) -> Quadrics:
    blocks = sums[:, :18].reshape(-1, 3, 6)[:, :, _SYMMETRIC]  # capsules x shares x 3 x 3
    first, mixed, last = blocks[:, 0], blocks[:, 1], blocks[:, 2]
    matrix = jnp.concatenate([jnp.concatenate([first, mixed], 2), jnp.concatenate([mixed, last], 2)], 1)
    return Quadrics(ends.reshape(-1, 6), matrix, sums[:, 18:], squared)
