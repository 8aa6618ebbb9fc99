"""Where rays through outlines come nearest to the silhouettes of all other views: looked up, then frozen."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..._runtime.compile_cache import cached_jit
from ...cameras import Cameras, optical_centres, project
from ._distance_images import DistanceImages
from ._sight_lines import SightLines

# No part of a person is farther from the middle of the body (m).
_REACH = 1.5
# Places along a ray that are looked at first, and then between the best of them and its neighbours on either side. Over
# three metres they are 24 mm and 2 mm apart, of which silhouettes at a usual distance show less than half a pixel.
_COARSE, _FINE = 128, 12
# What a view tells of a point that it does not see (px): beyond an image nobody knows where the person ends.
_UNKNOWN = -1e3


class Contacts(eqx.Module):
    """The place on each ray where the greatest distance to the silhouettes of the other views is least."""

    depth: Float[Array | np.ndarray, "*frames rays"]
    """Along the ray (m)."""
    judges: Int[Array | np.ndarray, "*frames rays 2"]
    """The cameras whose distances are the greatest just before the place, and just behind it."""
    share: Float[Array | np.ndarray, "*frames rays"]
    """Of the first judge in the residual; the second has the rest.

    Where one silhouette is entered as another is left, both hold the place. The shares are such that a small change of
    the depth would not change the residual, so with the depth frozen its derivatives are still those of the least
    greatest distance (envelope theorem; the shares are the multipliers of the two constraints).
    """
    known: Bool[Array | np.ndarray, "*frames rays"]
    """Some other view sees the place."""


@cached_jit
def find_contacts(
    cameras: Cameras,
    lines: SightLines,
    images: DistanceImages,
    middles: Float[Array | np.ndarray, "frames 3"],
) -> Contacts:
    """Look the contacts of some frames up.

    Args:
        cameras: The rig.
        lines: Rays, with a leading axis ``frames``.
        images: Distances to the silhouettes of the same frames.
        middles: Of the person in each frame (m).
    """
    views = jnp.arange(len(cameras), dtype=jnp.int32)
    arrays = jax.tree.map(jnp.asarray, cameras)
    centres = optical_centres(cameras)

    def one(given: tuple[Array, SightLines, Array]) -> Contacts:
        frame, lines, middle = given
        own = jnp.asarray(lines.camera)
        directions = jnp.einsum("rji,rj->ri", arrays.R[own], jnp.asarray(lines.directions))
        starts = centres[own]

        def distances(depth: Float[Array, "rays places"]) -> Float[Array, "cams rays places"]:
            points = starts[:, None] + depth[..., None] * directions[:, None]
            u, v, _ = (jnp.asarray(a).reshape(-1, *depth.shape) for a in project(arrays, points.reshape(-1, 3)))
            image = jnp.broadcast_to((frame * len(cameras) + views)[:, None, None], u.shape)
            distance, seen = images.at(image, u, v)
            return jnp.where(seen & (views[:, None, None] != own[None, :, None]), distance, _UNKNOWN)

        near, far = _around(starts - middle[None], directions)
        step = ((far - near) / (_COARSE - 1))[:, None]
        depth = near[:, None] + step * jnp.arange(_COARSE, dtype=step.dtype)[None]
        every = jnp.arange(len(depth), dtype=jnp.int32)
        best = depth[every, distances(depth).max(0).argmin(-1)]
        depth = best[:, None] + step * jnp.linspace(-1, 1, 2 * _FINE + 1, dtype=step.dtype)[None]
        found = distances(depth)
        place = jnp.clip(found.max(0).argmin(-1), 1, 2 * _FINE - 1)
        before, here, behind = (found[:, every, place + by] for by in (-1, 0, 1))
        first, last, alone = (distance.argmax(0) for distance in (before, behind, here))
        slope = behind - before
        falls, rises = slope[first, every], slope[last, every]
        two = (first != last) & (falls < 0) & (rises > 0)
        share = jnp.where(two, rises / jnp.where(two, rises - falls, 1.0), 1.0)
        judges = jnp.where(two[:, None], jnp.stack([first, last], -1), alone[:, None]).astype(jnp.int32)
        return Contacts(depth[every, place], judges, share, here.max(0) > _UNKNOWN)

    numbers = jnp.arange(len(middles), dtype=jnp.int32)
    return jax.lax.map(one, (numbers, jax.tree.map(jnp.asarray, lines), jnp.asarray(middles)))


def _around(
    starts: Float[Array, "rays 3"], directions: Float[Array, "rays 3"]
) -> tuple[Float[Array, " rays"], Float[Array, " rays"]]:
    """Where rays enter and leave the ball of `_REACH` around the origin (m); its nearest point where they miss it."""
    middle = -(starts * directions).sum(-1)
    half = jnp.sqrt(jnp.maximum(_REACH**2 - (starts**2).sum(-1) + middle**2, 0.0))
    return jnp.maximum(middle - half, 1e-3), jnp.maximum(middle + half, 2e-3)
