"""Derivatives of a kinematic chain by its unknowns, in closed form instead of by automatic differentiation."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..._math.rotations import cross
from ..terms import PlacedBody


class Motion(eqx.Module):
    """Unknowns that each rotate some segments about an axis through a point, or translate all segments.

    The velocity of a point x of a rotated segment is d x (x - p), for the rotation vector d and the pivot p.

    Attributes:
        turns: Rotation vector for one unit of each unknown, in the world (rad); zero for translations.
        pivots: A point on each axis, in the world (m).
        shifts: Translation for one unit of each unknown, in the world (m).
        moves: One where an unknown rotates a segment, else zero.
    """

    turns: Float[Array, "*stack unknowns 3"]
    pivots: Float[Array, "*stack unknowns 3"]
    shifts: Float[np.ndarray, "*stack unknowns 3"]
    moves: Float[np.ndarray, "*stack unknowns segments"]

    def some(self, unknowns: Int[np.ndarray, "*stack some"]) -> "Motion":
        """Select unknowns, or stacks of them."""
        return Motion(self.turns[unknowns], self.pivots[unknowns], self.shifts[unknowns], self.moves[unknowns])

    def moves_any(self, segments: Int[np.ndarray, "things some"]) -> Bool[np.ndarray, "unknowns things"]:
        """Which unknowns move any of the segments listed in each row."""
        return (self.moves[:, segments] > 0).any(2) | (self.shifts != 0).any(1)[:, None]

    def of_points(
        self, points: Float[Array, "*stack points 3"], segments: Int[np.ndarray, "*stack points"]
    ) -> Float[Array, "*stack points 3 unknowns"]:
        """Derivative of points (m, in the world) on given segments; unknowns as the last axis vectorise well."""
        turns, pivots, shifts = (
            jnp.asarray(a).swapaxes(-1, -2)[..., None, :, :] for a in (self.turns, self.pivots, self.shifts)
        )
        moves = np.take_along_axis(self.moves, segments[..., None, :], -1).swapaxes(-1, -2)[..., None, :]
        return cross(turns, points[..., None] - pivots, -2) * moves + shifts

    def of_body(self, placed: PlacedBody) -> PlacedBody:
        """Derivative of the placed skeleton, with a last axis ``unknowns``."""
        carriers, joints = placed.template.segments_of_points, len(placed.template.joint_names)
        turns = self.turns.T[None] * jnp.asarray(self.moves.T)[:, None]
        changes = (
            self.of_points(placed.joints, carriers[:joints]),
            self.of_points(placed.tips, carriers[joints:]),
            cross(turns[:, :, None], placed.rotations[..., None], 1),
            self.of_points(placed.origins, np.arange(len(placed.origins), dtype=np.int32)),
        )
        return eqx.tree_at(lambda b: (b.joints, b.tips, b.rotations, b.origins), placed, changes)
