"""Term for the limits of knees and elbows: one direction of flexion, within a range."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...body import SEGMENT_NAMES, Skeleton, hinge_axes
from ._base import AbstractTerm, Observed, PlacedBody, number

_UPPER, _LOWER = (
    np.array([SEGMENT_NAMES.index(side + name) for name in names for side in ("l_", "r_")], np.int32)
    for names in (("upper_arm", "thigh"), ("forearm", "shank"))
)
_UPPER_JOINT, _HINGE_JOINT = (np.array(a, np.int32) for a in ((3, 6, 9, 12), (4, 7, 10, 13)))


class HingeLimits(AbstractTerm):
    """Flexion of elbows and knees stays within limits, and they do not bend sideways.

    Attributes:
        straight: Smallest flexion (rad).
        folded: Largest flexion (rad).
    """

    needs_graph = False

    skeleton: Skeleton
    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    straight: Float[Array, ""] = eqx.field(converter=number, default=0.05)
    folded: Float[Array, ""] = eqx.field(converter=number, default=2.5)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "hinges=4 2"]:
        """For left and right elbow and knee: angle beyond the limits (rad), a third of the cosine to the side."""
        rest = jnp.asarray(self.skeleton.rest_joints)
        # The forearm ends at the wrist, the shank at the ankle: the ball of the foot stands in front of a straight leg.
        upper = rest[_HINGE_JOINT] - rest[_UPPER_JOINT]
        lower = jnp.asarray(self.skeleton.pivots) - rest[_HINGE_JOINT]
        axis = jnp.asarray(hinge_axes(self.skeleton))
        # Written out: the compiler is slow at many small products, and a solver's tangents multiply their number.
        bone = lower / jnp.linalg.norm(lower, axis=-1, keepdims=True)
        lower_turn, upper_turn = body.rotations[_LOWER], body.rotations[_UPPER]
        bone = sum((lower_turn[:, :, k] * bone[:, k, None] for k in range(3)), jnp.zeros(()))
        bone = sum((upper_turn[:, k] * bone[:, k, None] for k in range(3)), jnp.zeros(()))
        along = upper / jnp.linalg.norm(upper, axis=-1, keepdims=True)
        forward = jnp.cross(axis, along)
        flexion = jnp.arctan2((bone * forward).sum(-1), (bone * along).sum(-1))
        flexion = jnp.where(flexion < -np.pi / 2, flexion + 2 * np.pi, flexion)  # folded beyond 180 degrees
        beyond = jnp.maximum(self.straight - flexion, 0.0) + jnp.maximum(flexion - self.folded, 0.0)
        # The sideways bend of the rest pose is allowed.
        side = (bone * axis).sum(-1) - (lower / jnp.linalg.norm(lower, axis=-1, keepdims=True) * axis).sum(-1)
        return jnp.stack([beyond, side / 3], -1)
