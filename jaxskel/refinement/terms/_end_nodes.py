"""Term that attracts limb tips to the labelled end nodes of the graph (Sect. 3.2)."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...matching import END_NODE_REACH
from ._base import AbstractTerm, Observed, PlacedBody, number


class EndNodeAttraction(AbstractTerm):
    """Tips, such as head top, fingertips and toe tips, minus their end nodes; zero for a limb without an end node.

    Attributes:
        reach: Position of the end node between joint (0) and tip (1).
    """

    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    reach: Float[Array, ""] = eqx.field(converter=number, default=END_NODE_REACH)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "tips 3"]:
        """Differences between points on the last bones and the end nodes (m)."""
        joints = body.joints[np.array(body.template.tip_parents, np.int32)]
        ends = joints + self.reach * (body.tips - joints)
        return jnp.where(observed.found[:, None], ends - observed.paths[:, -1], 0.0)
