"""Term that attracts neck and pelvis to the inner nodes v_neck, v_pelvis of the graph (Eq. 6)."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._base import AbstractTerm, Observed, PlacedBody, number


class InnerNodeAttraction(AbstractTerm):
    """Pelvis and neck minus their nodes in the graph (Eq. 6)."""

    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "2 3"]:
        """Differences between joints and nodes (m)."""
        return body.joints[:2] - jnp.stack([observed.pelvis, observed.neck])
