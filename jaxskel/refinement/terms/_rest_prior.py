"""Prior for segments that the observations hardly constrain: near their rest rotation relative to the parent."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...body import SEGMENT_NAMES
from ._base import AbstractTerm, Observed, PlacedBody, number, number_if_any


def firmness(**segments: float) -> Float[np.ndarray, " segments"]:
    """Weight of each segment of the human template but the pelvis, by its name without the side.

    Segments not named are free.
    """
    return np.array([segments.get(name.removeprefix("l_").removeprefix("r_"), 0.0) for name in SEGMENT_NAMES[1:]])


class RestPrior(AbstractTerm):
    """Rotation of each segment relative to its parent segment, minus the identity.

    Attributes:
        firmness: Weight of each segment but the first, see [`firmness`][]. By default the template's, which is for
            fits to the graph.
    """

    needs_graph = False

    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    firmness: Float[Array, " segments"] | None = eqx.field(converter=number_if_any, default=None)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "segments 4"]:
        """Four numbers for each segment; their norm is that of the matrix difference, about 1.4 x the angle (rad)."""
        parents = np.array(body.template.segment_parents, np.int32)[1:]
        firm = number(body.template.firmness) if self.firmness is None else self.firmness
        parent, own = body.rotations[parents], body.rotations[1:]

        # Written out by elements: long rows of segments are faster than many small matrices.
        def relative(i: int, j: int) -> Float[Array, " segments"]:
            return sum((own[:, k, i] * parent[:, k, j] for k in range(3)), jnp.zeros(()))

        # For a rotation by angle a about axis n: sin(a) n, and 1 - cos(a).
        sine = [(relative(i, j) - relative(j, i)) / 2 for i, j in ((1, 2), (2, 0), (0, 1))]
        cosine = (relative(0, 0) + relative(1, 1) + relative(2, 2) - 1) / 2
        return jnp.sqrt(2 * firm)[:, None] * jnp.stack([*sine, 1 - cosine], -1)
