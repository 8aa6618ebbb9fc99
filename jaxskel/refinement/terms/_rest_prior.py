"""Segments that the graph hardly sees stay near their rest position relative to the segment they hang on."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...body import SEGMENT_NAMES, SEGMENT_PARENTS
from ._base import AbstractTerm, Observed, PlacedBody, number

# 32 bits, because JAX mixes up wider indices when float64 is switched on after the first use.
_PARENTS = np.array(SEGMENT_PARENTS, np.int32)[1:]


def firmness(**segments: float) -> Float[np.ndarray, "segments=16"]:
    """How firmly each segment but the pelvis is held, by its name without the side; those not named swing freely."""
    return np.array([segments.get(name.removeprefix("l_").removeprefix("r_"), 0.0) for name in SEGMENT_NAMES[1:]])


# Shoulder blades move little, limbs swing freely.
_SEEN_AS_GRAPH = firmness(chest=1.0, head=0.5, clavicle=3.0, thigh=0.2, shank=0.2, upper_arm=0.05, forearm=0.1)


class RestPrior(AbstractTerm):
    """Relative rotation of each segment to its parent segment minus the identity."""

    needs_graph = False

    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    firmness: Float[Array, "segments=16"] = eqx.field(converter=number, default_factory=_SEEN_AS_GRAPH.copy)
    """Weight of each segment but the pelvis, see [`firmness`][]."""

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "segments=16 4"]:
        """Four numbers with the norm of the difference of two rotation matrices, about 1.4 times the angle (rad)."""
        parent, own = body.rotations[_PARENTS], body.rotations[1:]

        # Written out by elements: long rows of segments are faster than many small matrices.
        def relative(i: int, j: int) -> Float[Array, " segments=16"]:
            return sum((own[:, k, i] * parent[:, k, j] for k in range(3)), jnp.zeros(()))

        # With the angle a about the axis n: sin(a) n, and 1 - cos(a).
        sine = [(relative(i, j) - relative(j, i)) / 2 for i, j in ((1, 2), (2, 0), (0, 1))]
        cosine = (relative(0, 0) + relative(1, 1) + relative(2, 2) - 1) / 2
        return jnp.sqrt(2 * self.firmness)[:, None] * jnp.stack([*sine, 1 - cosine], -1)
