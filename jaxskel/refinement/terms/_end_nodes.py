"""Term that attracts limb tips to the labelled end nodes of the graph (Sect. 3.2)."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...body import TIP_PARENTS
from ...matching import END_NODE_REACH
from ._base import AbstractTerm, Observed, PlacedBody, number


class EndNodeAttraction(AbstractTerm):
    """Head top, fingertips and toe tips minus their end nodes; zero for a limb without an end node.

    Attributes:
        reach: Position of the end node between joint (0) and tip (1).
    """

    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    reach: Float[Array, ""] = eqx.field(converter=number, default=END_NODE_REACH)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "tips 3"]:
        """Differences between points on the last bones and the end nodes (m)."""
        joints = body.joints[np.array(TIP_PARENTS)]
        ends = joints + self.reach * (body.tips - joints)
        return jnp.where(observed.found[:, None], ends - observed.paths[:, -1], 0.0)
