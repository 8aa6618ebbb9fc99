"""Knees and elbows bend one way, and only so far."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._skeleton import JOINT_NAMES, SEGMENT_NAMES
from ._base import AbstractTerm, Observed, PlacedBody

_SIDES = ("l", "r")


class HingeLimits(AbstractTerm):
    """The shank may not bend to the front of the thigh, nor much to its side; no limb may fold up completely."""

    weight: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=1.0)
    play: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.1)
    """Sine of the angle by which a knee may be overstretched."""
    folded: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.85)
    """Cosine of the angle to the reversed upper bone at which a limb counts as folded up."""

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "limbs=2 4"]:
        """For each side: knee to the front, knee to the side (a third), knee folded, elbow folded; all sines."""
        rows = []
        for side in _SIDES:
            thigh = body.rotations[SEGMENT_NAMES.index(f"{side}_thigh")]
            shank = -body.rotations[SEGMENT_NAMES.index(f"{side}_shank")][:, 2]  # downwards; straight at rest
            front, left, knee = shank @ thigh[:, 0], shank @ thigh[:, 1], shank @ thigh[:, 2]
            elbow = -_bone(body, f"{side}_elbow", f"{side}_hand") @ _bone(body, f"{side}_shoulder", f"{side}_elbow")
            over = jnp.maximum(jnp.stack([front - self.play, knee - self.folded, elbow - self.folded]), 0.0)
            rows.append(jnp.stack([over[0], left / 3, over[1], over[2]]))
        return jnp.stack(rows)


def _bone(body: PlacedBody, start: str, end: str) -> Float[Array, "3"]:
    bone = body.joints[JOINT_NAMES.index(end)] - body.joints[JOINT_NAMES.index(start)]
    return bone / jnp.linalg.norm(bone)
