"""Prior for segments that the observations hardly constrain: near their rest rotation relative to the parent."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...body import SEGMENT_NAMES, SEGMENT_PARENTS
from ._base import AbstractTerm, Observed, PlacedBody, number

# 32 bits, because JAX mixes up wider indices when float64 is switched on after the first use.
_PARENTS = np.array(SEGMENT_PARENTS, np.int32)[1:]


def firmness(**segments: float) -> Float[np.ndarray, "segments=16"]:
    """Weight of each segment but the pelvis, by its name without the side; segments not named are free."""
    return np.array([segments.get(name.removeprefix("l_").removeprefix("r_"), 0.0) for name in SEGMENT_NAMES[1:]])


# For fits to the graph: shoulder blades move little, limbs swing freely.
_SEEN_AS_GRAPH = firmness(chest=1.0, head=0.5, clavicle=3.0, thigh=0.2, shank=0.2, upper_arm=0.05, forearm=0.1)


class RestPrior(AbstractTerm):
    """Rotation of each segment relative to its parent segment, minus the identity.

    Attributes:
        firmness: Weight of each segment but the pelvis, see [`firmness`][].
    """

    needs_graph = False

    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    firmness: Float[Array, "segments=16"] = eqx.field(converter=number, default_factory=_SEEN_AS_GRAPH.copy)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "segments=16 4"]:
        """Four numbers for each segment; their norm is that of the matrix difference, about 1.4 x the angle (rad)."""
        parent, own = body.rotations[_PARENTS], body.rotations[1:]

        # Written out by elements: long rows of segments are faster than many small matrices.
        def relative(i: int, j: int) -> Float[Array, " segments=16"]:
            return sum((own[:, k, i] * parent[:, k, j] for k in range(3)), jnp.zeros(()))

        # For a rotation by angle a about axis n: sin(a) n, and 1 - cos(a).
        sine = [(relative(i, j) - relative(j, i)) / 2 for i, j in ((1, 2), (2, 0), (0, 1))]
        cosine = (relative(0, 0) + relative(1, 1) + relative(2, 2) - 1) / 2
        return jnp.sqrt(2 * self.firmness)[:, None] * jnp.stack([*sine, 1 - cosine], -1)
