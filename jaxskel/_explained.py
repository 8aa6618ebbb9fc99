"""Whether a pose explains what was seen: how much of the outlines is left over."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._body import Body, capsule_ends
from ._capsules import nearest_to_rays
from ._contours import Contours
from ._kept import kept
from ._skeleton import Pose
from .terms import place

# An outline no farther from the body than this may be its own (m).
_NEAR = 0.04


@kept
def unexplained_shares(body: Body, poses: Pose, contours: Contours) -> Float[Array, " frames"]:
    """Share of each frame's outlines that lie outside of the body, and not near it."""

    def share(pose: Pose, contours: Contours) -> Array:
        placed = place(body.skeleton, pose)
        ends = jnp.asarray(capsule_ends(body, placed.origins, placed.rotations))
        radii = jnp.asarray(body.radii)[body.links]
        near = nearest_to_rays(jnp.asarray(contours.centres), jnp.asarray(contours.directions), ends, radii)
        return (near.distance > _NEAR).mean()

    return jax.vmap(share)(poses, contours)
