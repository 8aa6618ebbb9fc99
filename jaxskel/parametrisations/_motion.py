"""How a chain of segments begins to move: the derivative of all that it carries, written down instead of traced."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._skeleton import JOINT_OF_PIVOT, SEGMENT_NAMES, SEGMENT_OF_JOINT, SEGMENT_OF_PIVOT, SEGMENT_OF_TIP
from ..terms import PlacedBody

# The segment that carries each joint; those at the end of a bone with a pivot in it are carried by its outer part.
_CARRIERS = np.array(SEGMENT_OF_JOINT, np.int32)
_CARRIERS[np.array(JOINT_OF_PIVOT)] = SEGMENT_OF_PIVOT
_TIPS, _SEGMENTS = np.array(SEGMENT_OF_TIP, np.int32), np.arange(len(SEGMENT_NAMES), dtype=np.int32)


class Motion(eqx.Module):
    """Unknowns that each turn some segments about an axis through a point, or shift them all.

    A point x of a turned segment moves by d x (x - p) with the rotation vector d and the pivot p.
    """

    turns: Float[Array, "unknowns 3"]
    """Rotation vector for one unit of each unknown, in the world (rad); zero for those that shift."""
    pivots: Float[Array, "unknowns 3"]
    """A point of each axis (m)."""
    shifts: Float[np.ndarray, "unknowns 3"]
    """(m) for one unit of each unknown."""
    moves: Float[np.ndarray, "unknowns segments=17"]
    """One where a segment is turned by an unknown, else zero."""

    def of_points(
        self, points: Float[Array, "points 3"], segments: Int[np.ndarray, " points"]
    ) -> tuple[Float[Array, "unknowns points"], ...]:
        """How points (m) of some segments begin to move, by x, y and z: long rows, not triples."""
        x, y, z = (points[None, :, axis] - self.pivots[:, axis, None] for axis in range(3))
        a, b, c = (self.turns[:, axis, None] for axis in range(3))
        moved = jnp.asarray(self.moves[:, segments])
        across = b * z - c * y, c * x - a * z, a * y - b * x
        return tuple(moved * part + self.shifts[:, axis, None] for axis, part in enumerate(across))

    def of_body(self, placed: PlacedBody) -> PlacedBody:
        """How the skeleton begins to move, with a leading axis ``unknowns``."""
        turns = jnp.asarray(self.moves)[:, :, None] * self.turns[:, None]
        columns = jnp.cross(turns[:, :, None], placed.rotations.swapaxes(1, 2)[None])
        changes = (
            jnp.stack(self.of_points(placed.joints, _CARRIERS), -1),
            jnp.stack(self.of_points(placed.tips, _TIPS), -1),
            columns.swapaxes(2, 3),
            jnp.stack(self.of_points(placed.origins, _SEGMENTS), -1),
        )
        return eqx.tree_at(lambda b: (b.joints, b.tips, b.rotations, b.origins), placed, changes)
