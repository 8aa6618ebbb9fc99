"""Term for equal left and right bone lengths, for parametrisations with free lengths."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._base import AbstractTerm, Observed, PlacedBody, number


class Symmetry(AbstractTerm):
    """Length of each left bone minus that of the right one; constant where a parametrisation fixes the lengths."""

    needs_graph = False

    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, " pairs"]:
        """Differences of length (m)."""
        template = body.template
        left = np.array([i for i, name in enumerate(template.joint_names) if name.startswith("l_")], np.int32)

        def lengths(ends: np.ndarray) -> Float[Array, " pairs"]:
            return jnp.sqrt(((body.joints[ends] - body.joints[template.point_parents[ends]]) ** 2).sum(-1))

        return lengths(left) - lengths(template.mirror_joints[left])
