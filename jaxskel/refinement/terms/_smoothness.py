"""Term for smooth motion: penalises accelerations of the joints."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._base import AbstractCoupling, PlacedBody, number


class Smoothness(AbstractCoupling):
    """Acceleration of joints and tips, from three consecutive frames. For `refine_sequence`.

    Attributes:
        fps: Frames per second.
        scale: Acceleration (m/s^2) of unit cost: by default about that of free fall, which a limb seldom exceeds for
            long.
    """

    fps: Float[Array, ""] = eqx.field(converter=number)
    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    scale: Float[Array, ""] = eqx.field(converter=number, default=10.0)

    def residual(self, before: PlacedBody, body: PlacedBody, after: PlacedBody) -> Float[Array, "points 3"]:
        """Accelerations divided by the scale."""
        first, middle, last = (jnp.concatenate([each.joints, each.tips]) for each in (before, body, after))
        return (first - 2 * middle + last) * self.fps**2 / self.scale
