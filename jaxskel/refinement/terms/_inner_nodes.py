"""Term that attracts inner joints to their nodes in the graph: v_neck and v_pelvis of a human (Eq. 6)."""

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from ._base import AbstractTerm, Observed, PlacedBody, number


class InnerNodeAttraction(AbstractTerm):
    """The template's inner joints, pelvis and neck of a human, minus their nodes in the graph (Eq. 6)."""

    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "inner 3"]:
        """Differences between joints and nodes (m)."""
        return body.joints[np.array(body.template.inner, np.int32)] - observed.inner
