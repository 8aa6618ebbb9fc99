"""Share of the outlines that a pose leaves unexplained, and the trust in a pose that follows from it."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._runtime.compile_cache import cached_jit
from ..body import Body, Pose, capsule_ends, nearest_to_rays
from ..outlines import Contours
from ..refinement.terms import place

# An outline ray closer to the body than this is explained (m).
_NEAR = 0.04
# Unexplained share that holes and blobs in poor masks cause on their own.
_POOR_MASKS = 0.125
# Above this unexplained share, the fit is to something other than the subject.
NOT_THE_SUBJECT = 0.4


def trust_in_explained(shares: Float[np.ndarray, " frames"]) -> Float[np.ndarray, " frames"]:
    """Trust in poses that leave these shares of the outlines unexplained, from 0 to 1.

    Objects that a person sits on or holds are in the silhouettes too; both they and what they hide bias the fit.
    """
    return np.clip((NOT_THE_SUBJECT - shares) / (NOT_THE_SUBJECT - _POOR_MASKS), 0.0, 1.0)


@cached_jit
def unexplained_shares(body: Body, poses: Pose, contours: Contours) -> Float[Array, " frames"]:
    """Share of each frame's outline rays that pass the body at a distance of more than 4 cm."""

    def share(pose: Pose, contours: Contours) -> Array:
        placed = place(body.skeleton, pose)
        ends = jnp.asarray(capsule_ends(body, placed.origins, placed.rotations))
        radii = jnp.asarray(body.radii)[body.links]
        near = nearest_to_rays(jnp.asarray(contours.centres), jnp.asarray(contours.directions), ends, radii)
        return (near.distance > _NEAR).mean()

    return jax.vmap(share)(poses, contours)
