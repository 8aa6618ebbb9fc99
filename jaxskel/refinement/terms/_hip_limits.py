"""Term for the limit of the hips: thighs do not point far behind the trunk."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._math.rotations import cross, dot
from ...body import JOINT_NAMES
from ._base import AbstractTerm, Observed, PlacedBody, number

_HIP, _KNEE = (np.array([JOINT_NAMES.index(f"{side}_{name}") for side in "lr"], np.int32) for name in ("hip", "knee"))
_PELVIS, _NECK = (JOINT_NAMES.index(name) for name in ("pelvis", "neck"))


class HipLimits(AbstractTerm):
    """How far the direction of each thigh points behind the trunk, beyond a limit.

    Whoever bends down looks from most sides like somebody who faces the other way and leans as far back.

    Attributes:
        limit: Largest component to the back of the thigh's direction. Of 5100 thighs in 78 recordings, 99 % have less
            than 0.39, none more than 0.65, and the median has -0.3.
    """

    needs_graph = False

    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    limit: Float[Array, ""] = eqx.field(converter=number, default=0.5)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "legs=2"]:
        """Component to the back beyond the limit, of the left and of the right thigh."""
        joints = body.joints
        across = cross(joints[_HIP[0]] - joints[_HIP[1]], joints[_NECK] - joints[_PELVIS])
        front = across / jnp.sqrt(dot(across, across) + 1e-12)
        thighs = joints[_KNEE] - joints[_HIP]
        back = -dot(thighs, front) / jnp.sqrt(dot(thighs, thighs) + 1e-12)
        return jnp.maximum(back - self.limit, 0.0)
