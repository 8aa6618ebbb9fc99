"""Term for equal left and right bone lengths, for parametrisations with free lengths."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...body import JOINT_NAMES, JOINT_PARENTS, MIRROR_JOINTS
from ._base import AbstractTerm, Observed, PlacedBody, number

_LEFT = np.array([i for i, name in enumerate(JOINT_NAMES) if name.startswith("l_")], np.int32)
_RIGHT = np.array(MIRROR_JOINTS, np.int32)[_LEFT]
_PARENTS = np.array(JOINT_PARENTS, np.int32)


class Symmetry(AbstractTerm):
    """Length of each left bone minus that of the right one; constant where a parametrisation fixes the lengths."""

    needs_graph = False

    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "pairs=6"]:
        """Differences of length (m)."""

        def lengths(ends: np.ndarray) -> Float[Array, "pairs=6"]:
            return jnp.sqrt(((body.joints[ends] - body.joints[_PARENTS[ends]]) ** 2).sum(-1))

        return lengths(_LEFT) - lengths(_RIGHT)
