"""Normal equations of capsules that hang on a tree, without what the tree makes zero.

No unknown of an arm moves a capsule that one of a leg moves, so their block of the normal matrix is zero, and so are
the rows of an arm's Jacobian at most of the capsules. What limbs have in common is the trunk.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..refinement.parametrisations import Motion


class Limbs(NamedTuple):
    """Unknowns of which those of different limbs move no capsule together; filled up with -1 to be stacked."""

    trunk: Int[np.ndarray, " trunk"]
    """Unknowns that move capsules together with those of several limbs."""
    own: Int[np.ndarray, "limbs own"]
    """All other unknowns."""
    capsules: Int[np.ndarray, "limbs most"]
    """Those that the unknowns of each limb move; there may be others, which only the trunk moves."""


def limbs_of(moved: Bool[np.ndarray, "unknowns capsules"]) -> Limbs:
    """Take a body apart by which unknowns move which capsules."""
    together = moved @ moved.T
    # Of the trunk is what moves capsules with two others that by themselves have none in common.
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
    """Normal matrix and half the gradient of what capsules cost: d . matrix d - 2 vector . d if their ends move by d.

    Args:
        motion: How the unknowns begin to move what they move.
        ends: Of the capsules (m).
        segments: That carry the ends.
        matrix: Of the cost of each capsule, see `Quadrics`.
        vector: Likewise.
    """
    limbs = limbs_of(motion.moves_any(segments))
    shared = _moved(motion.some(limbs.trunk), ends, segments)
    # What pulls at the capsules is one column more.
    forces = jnp.concatenate([_flat(_product(matrix, shared)), -vector.reshape(-1, 1)], -1)
    of_trunk = _flat(shared).T @ forces

    there = limbs.capsules >= 0
    chosen = np.where(there, limbs.capsules, 0)
    own = _moved(motion.some(np.maximum(limbs.own, 0)), ends[chosen], segments[chosen]) * there[..., None, None]
    # Looked up in what the product above has stored already.
    rows = (6 * chosen[..., None] + np.arange(6, dtype=np.int32)).reshape(len(chosen), 6 * chosen.shape[1])
    acting = jnp.concatenate([_flat(_product(matrix[chosen], own)), forces[rows]], -1)
    of_limbs = jnp.einsum("lku,lkv->luv", _flat(own), acting)

    numbers = jnp.concatenate([of_trunk.ravel(), of_limbs.ravel(), jnp.zeros(1, ends.dtype)])
    found = numbers[_places(limbs, len(motion.turns))]
    return found[:, :-1], found[:, -1]


def _moved(
    motion: Motion, ends: Float[Array, "*limbs capsules 2 3"], segments: Int[np.ndarray, "*limbs capsules 2"]
) -> Float[Array, "*limbs capsules 6 unknowns"]:
    """How both ends of capsules begin to move."""
    *stack, capsules, _ = segments.shape
    moved = motion.of_points(ends.reshape(*stack, 2 * capsules, 3), segments.reshape(*stack, 2 * capsules))
    return moved.reshape(*stack, capsules, 6, moved.shape[-1])


def _product(
    matrix: Float[Array, "*capsules 6 6"], moved: Float[Array, "*capsules 6 unknowns"]
) -> Float[Array, "*capsules 6 unknowns"]:
    """Written out: rows of unknowns are long enough for a processor, small matrices are not."""
    return sum((matrix[..., k, None] * moved[..., k, None, :] for k in range(6)), jnp.zeros((), moved.dtype))


def _flat(rows: Float[Array, "*limbs capsules 6 columns"]) -> Float[Array, "*limbs rows columns"]:
    *stack, _, _, columns = rows.shape
    return rows.reshape(*stack, rows.shape[-3] * 6, columns)


def _places(limbs: Limbs, count: int) -> Int[np.ndarray, "unknowns columns"]:
    """Where the entries of the normal matrix, and in one column more the gradient, stand in those of the blocks."""
    trunk, beyond = len(limbs.trunk), np.array([*limbs.trunk, count])
    size = trunk * (trunk + 1) + limbs.own.size * (limbs.own.shape[1] + trunk + 1)
    places = np.full((count + 1, count + 1), size)  # of the zero at the end
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
