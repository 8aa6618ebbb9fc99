"""Segments that the graph hardly sees stay near their rest position relative to the segment they hang on."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._skeleton import SEGMENT_NAMES, SEGMENT_PARENTS
from ._base import AbstractTerm, Observed, PlacedBody

# How firmly a segment is held, relative to the chest: shoulder blades move little, limbs swing freely.
_FIRMNESS = {"chest": 1.0, "head": 0.5, "l_clavicle": 3.0, "r_clavicle": 3.0, "l_thigh": 0.2, "r_thigh": 0.2,
             "l_shank": 0.2, "r_shank": 0.2, "l_upper_arm": 0.05, "r_upper_arm": 0.05, "l_forearm": 0.1,
             "r_forearm": 0.1}  # fmt: skip
# 32 bits, because JAX mixes up wider indices when float64 is switched on after the first use.
_SEGMENTS = np.array([SEGMENT_NAMES.index(name) for name in _FIRMNESS], np.int32)
_PARENTS = np.array(SEGMENT_PARENTS, np.int32)[_SEGMENTS]
_HELD = np.sqrt(np.array(list(_FIRMNESS.values())))


class RestPrior(AbstractTerm):
    """Relative rotation of each segment to its parent segment minus the identity."""

    weight: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=1.0)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "segments=12 3 3"]:
        """Differences of rotation matrices; their norm is about 1.4 times the angle (rad)."""
        relative = jnp.einsum("sji,sjk->sik", body.rotations[_PARENTS], body.rotations[_SEGMENTS])
        return jnp.asarray(_HELD)[:, None, None] * (relative - jnp.eye(3)[None])
