"""Term for the limits of hinges, such as knees and elbows: one direction of flexion, within a range."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...body import Skeleton, hinge_axes
from ._base import AbstractTerm, Observed, PlacedBody, number, number_if_any


class HingeLimits(AbstractTerm):
    """Flexion of the template's hinges stays within limits, and they do not bend sideways.

    Attributes:
        straight: Smallest flexion (rad), of all or of each; by default the template's.
        folded: Largest flexion (rad).
    """

    needs_graph = False

    skeleton: Skeleton
    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    straight: Float[Array, "*hinges"] | None = eqx.field(converter=number_if_any, default=None)
    folded: Float[Array, "*hinges"] | None = eqx.field(converter=number_if_any, default=None)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "hinges 2"]:
        """For each hinge: angle beyond the limits (rad), a third of the cosine to the side."""
        template, rest = self.skeleton.template, jnp.asarray(self.skeleton.rest_joints)
        joints, lower_segments, ends = np.array([hinge[:3] for hinge in template.hinges], np.int32).T
        upper_segments = np.array(template.segment_parents, np.int32)[lower_segments]
        straight, folded = (
            number([hinge[field] for hinge in template.hinges]) if own is None else own
            for own, field in ((self.straight, 4), (self.folded, 5))
        )
        # The forearm ends at the wrist, the shank at the ankle: the ball of the foot stands in front of a straight leg.
        upper = rest[joints] - rest[template.point_parents[joints]]
        points = jnp.concatenate([rest, jnp.asarray(self.skeleton.rest_tips), jnp.asarray(self.skeleton.pivots)])
        lower = points[ends] - rest[joints]
        axis = jnp.asarray(hinge_axes(self.skeleton))
        # Written out: the compiler is slow at many small products, and a solver's tangents multiply their number.
        bone = lower / jnp.linalg.norm(lower, axis=-1, keepdims=True)
        lower_turn, upper_turn = body.rotations[lower_segments], body.rotations[upper_segments]
        bone = sum((lower_turn[:, :, k] * bone[:, k, None] for k in range(3)), jnp.zeros(()))
        bone = sum((upper_turn[:, k] * bone[:, k, None] for k in range(3)), jnp.zeros(()))
        along = upper / jnp.linalg.norm(upper, axis=-1, keepdims=True)
        forward = jnp.cross(axis, along)
        flexion = jnp.arctan2((bone * forward).sum(-1), (bone * along).sum(-1))
        flexion = jnp.where(flexion < -np.pi / 2, flexion + 2 * np.pi, flexion)  # folded beyond 180 degrees
        beyond = jnp.maximum(straight - flexion, 0.0) + jnp.maximum(flexion - folded, 0.0)
        # The sideways bend of the rest pose is allowed.
        side = (bone * axis).sum(-1) - (lower / jnp.linalg.norm(lower, axis=-1, keepdims=True) * axis).sum(-1)
        return jnp.stack([beyond, side / 3], -1)
