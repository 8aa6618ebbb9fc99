"""Whether a pose explains what was seen: how much of the outlines is left over."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._runtime.compile_cache import cached_jit
from ..body import Body, Pose, capsule_ends, nearest_to_rays
from ..outlines import Contours
from ..refinement.terms import place

# An outline no farther from the body than this may be its own (m).
_NEAR = 0.04
# Holes and blobs in poor masks leave this share of the outlines to nobody.
_POOR_MASKS = 0.125
# A fit that leaves this share to nobody is of something else than the subject.
NOT_THE_SUBJECT = 0.4


def trust_in_explained(shares: Float[np.ndarray, " frames"]) -> Float[np.ndarray, " frames"]:
    """How far to trust poses that leave these shares of the outlines to nobody, from 0 to 1.

    What the person sits on or holds is in the silhouettes too: it pulls at the body, as does what it hides.
    """
    return np.clip((NOT_THE_SUBJECT - shares) / (NOT_THE_SUBJECT - _POOR_MASKS), 0.0, 1.0)


@cached_jit
def unexplained_shares(body: Body, poses: Pose, contours: Contours) -> Float[Array, " frames"]:
    """Share of each frame's outlines that lie outside of the body, and not near it."""

    def share(pose: Pose, contours: Contours) -> Array:
        placed = place(body.skeleton, pose)
        ends = jnp.asarray(capsule_ends(body, placed.origins, placed.rotations))
        radii = jnp.asarray(body.radii)[body.links]
        near = nearest_to_rays(jnp.asarray(contours.centres), jnp.asarray(contours.directions), ends, radii)
        return (near.distance > _NEAR).mean()

    return jax.vmap(share)(poses, contours)
