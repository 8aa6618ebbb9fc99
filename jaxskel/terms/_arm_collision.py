"""Forearms and hands do not run through head, trunk and legs."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._body import Body, capsule_ends
from .._capsules import all_distances
from .._skeleton import SEGMENT_NAMES
from ._base import AbstractTerm, Observed, PlacedBody

_ARM = np.array([name[2:] in ("clavicle", "upper_arm", "forearm") for name in SEGMENT_NAMES])
_FOREARM = np.array([name.endswith("forearm") for name in SEGMENT_NAMES])


class ArmCollision(AbstractTerm):
    """How deep the ends of the forearms' capsules lie in any capsule that belongs to no arm."""

    body: Body
    weight: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=1.0)
    share: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.6)
    """Share of an arm's radius that must stay outside: flesh gives way."""

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "capsules 2"]:
        """Depths of penetration (m), zero outside."""
        segments, radii = jnp.asarray(self.body.segments), jnp.asarray(self.body.radii)
        ends = jnp.asarray(capsule_ends(self.body, body.joints, body.rotations))
        distances = all_distances(ends.reshape(-1, 3), ends, radii)
        other = ~jnp.asarray(_ARM)[segments].any(1)
        # Not min(): compiled, its gradient asks whether two roundings of the same number are equal.
        nearest = jnp.argmin(jnp.where(other[None], distances, jnp.inf), 1)
        distance = jnp.take_along_axis(distances, nearest[:, None], 1).reshape(-1, 2)
        depth = self.share * radii - distance
        return jnp.where(jnp.asarray(_FOREARM)[segments], jnp.maximum(depth, 0.0), 0.0)
