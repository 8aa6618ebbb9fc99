"""Normal equations of the capsules of a kinematic tree, without the blocks that are zero.

No unknown of an arm moves a capsule that an unknown of a leg moves, so their block of the normal matrix is zero, as are
the rows of an arm's Jacobian for most capsules. Only the unknowns of the trunk couple the limbs.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..refinement.parametrisations import Motion


class Limbs(NamedTuple):
    """Groups of unknowns; no capsule is moved by two of different limbs. Rows are padded with -1 to equal lengths.

    Attributes:
        trunk: Unknowns of the trunk: those that share capsules with the unknowns of several limbs.
        own: All other unknowns, by limb.
        capsules: Capsules that each limb's unknowns move; others may exist that only the trunk moves.
    """

    trunk: Int[np.ndarray, " trunk"]
    own: Int[np.ndarray, "limbs own"]
    capsules: Int[np.ndarray, "limbs most"]


def limbs_of(moved: Bool[np.ndarray, "unknowns capsules"]) -> Limbs:
    """Split the unknowns into trunk and limbs by which capsules they move."""
    together = moved @ moved.T
    # An unknown belongs to the trunk if it shares capsules with two others that share none with each other.
    trunk = np.array([not together[np.ix_(near, near)].all() for near in together])
    linked = together & ~trunk & ~trunk[:, None] | np.eye(len(moved), dtype=bool)
    while (farther := linked @ linked).sum() > linked.sum():
        linked = farther
    limbs = [np.flatnonzero(limb) for limb in np.unique(linked[~trunk], axis=0)]
    return Limbs(
        np.flatnonzero(trunk).astype(np.int32),
        _stacked(limbs),
        _stacked([np.flatnonzero(moved[limb].any(0)) for limb in limbs]),
    )


def normal_equations(
    motion: Motion,
    ends: Float[Array, "capsules 2 3"],
    segments: Int[np.ndarray, "capsules 2"],
    matrix: Float[Array, "capsules 6 6"],
    vector: Float[Array, "capsules 6"],
) -> tuple[Float[Array, "unknowns unknowns"], Float[Array, " unknowns"]]:
    """Normal matrix and half the gradient of the cost d . matrix d - 2 vector . d of displacements d of capsule ends.

    Args:
        motion: Derivatives of the body by the unknowns.
        ends: Ends of the capsules (m, in the world).
        segments: Segments that carry the ends.
        matrix: Quadratic coefficients of each capsule's cost, see `Quadrics`.
        vector: Linear coefficients, see `Quadrics`.
    """
    limbs = limbs_of(motion.moves_any(segments))
    shared = _moved(motion.some(limbs.trunk), ends, segments)
    # The vector is one more column of the right-hand factor.
    forces = jnp.concatenate([_flat(_product(matrix, shared)), -vector.reshape(-1, 1)], -1)
    of_trunk = _flat(shared).T @ forces

    there = limbs.capsules >= 0
    chosen = np.where(there, limbs.capsules, 0)
    own = _moved(motion.some(np.maximum(limbs.own, 0)), ends[chosen], segments[chosen]) * there[..., None, None]
    # The trunk's part of the limbs' capsules is taken from the product above.
    rows = (6 * chosen[..., None] + np.arange(6, dtype=np.int32)).reshape(len(chosen), 6 * chosen.shape[1])
    # Two products, because one with joined columns would copy them.
    columns = _flat(_product(matrix[chosen], own)), forces[rows]
    of_limbs = jnp.concatenate([jnp.einsum("lku,lkv->luv", _flat(own), some) for some in columns], -1)

    numbers = jnp.concatenate([of_trunk.ravel(), of_limbs.ravel(), jnp.zeros(1, ends.dtype)])
    found = numbers[_places(limbs, len(motion.turns))]
    return found[:, :-1], found[:, -1]


def _moved(
    motion: Motion, ends: Float[Array, "*limbs capsules 2 3"], segments: Int[np.ndarray, "*limbs capsules 2"]
) -> Float[Array, "*limbs capsules 6 unknowns"]:
    """Derivative of both ends of the capsules by the unknowns."""
    *stack, capsules, _ = segments.shape
    moved = motion.of_points(ends.reshape(*stack, 2 * capsules, 3), segments.reshape(*stack, 2 * capsules))
    return moved.reshape(*stack, capsules, 6, moved.shape[-1])


def _product(
    matrix: Float[Array, "*capsules 6 6"], moved: Float[Array, "*capsules 6 unknowns"]
) -> Float[Array, "*capsules 6 unknowns"]:
    """Matrix product, written out over the six rows: faster than many small matrix products."""
    return sum((matrix[..., k, None] * moved[..., k, None, :] for k in range(6)), jnp.zeros((), moved.dtype))


def _flat(rows: Float[Array, "*limbs capsules 6 columns"]) -> Float[Array, "*limbs rows columns"]:
    *stack, _, _, columns = rows.shape
    return rows.reshape(*stack, rows.shape[-3] * 6, columns)


def _places(limbs: Limbs, count: int) -> Int[np.ndarray, "unknowns columns"]:
    """Index into the concatenated blocks of each entry of the normal matrix, with the gradient as a last column."""
    trunk, beyond = len(limbs.trunk), np.array([*limbs.trunk, count])
    size = trunk * (trunk + 1) + limbs.own.size * (limbs.own.shape[1] + trunk + 1)
    places = np.full((count + 1, count + 1), size)  # index of the zero at the end
    at = trunk * (trunk + 1)
    places[np.ix_(limbs.trunk, beyond)] = np.arange(at).reshape(trunk, trunk + 1)
    for own in limbs.own:
        columns = np.concatenate([own, beyond])
        for row in own:
            block = at + np.arange(len(columns))
            at += len(columns)
            if row >= 0:
                places[row, columns[columns >= 0]] = block[columns >= 0]
                places[columns[columns >= 0], row] = block[columns >= 0]
    return places[:count].astype(np.int32)


def _stacked(rows: list[Int[np.ndarray, " _"]]) -> Int[np.ndarray, "rows longest"]:
    filled = np.full((len(rows), max(map(len, rows), default=0)), -1, np.int32)
    for filling, row in zip(filled, rows, strict=True):
        filling[: len(row)] = row
    return filled
