"""Finds where rays through outlines come nearest to the silhouettes of all other views; the places are then frozen."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..._runtime.compile_cache import cached_jit
from ...cameras import Cameras, optical_centres, project
from ._distance_images import DistanceImages
from ._sight_lines import SightLines

# Largest distance of a body part from the middle of the body (m).
_REACH = 1.5
# Numbers of samples along a ray: coarse ones, then fine ones between the best and its neighbours on either side. Over
# three metres they are 24 mm and 2 mm apart; 2 mm are less than half a pixel at usual distances.
_COARSE, _FINE = 128, 12
# Distance reported by a view that does not see a point (px): outside an image the person may be anywhere.
_UNKNOWN = -1e3


class Contacts(eqx.Module):
    """The place on each ray where the largest distance to the silhouettes of the other views is least.

    Attributes:
        depth: Distance along the ray (m).
        judges: The cameras with the largest distances just before and just behind the place.
        share: Weight of the first judge in the residual; the second has the rest. Where the ray enters one silhouette
            as it leaves another, both determine the place. The weights make the residual stationary in the depth, so
            its derivatives at frozen depth equal those of the minimised largest distance (envelope theorem; the weights
            are the multipliers of the two constraints).
        known: Whether some other view sees the place.
    """

    depth: Float[Array | np.ndarray, "*frames rays"]
    judges: Int[Array | np.ndarray, "*frames rays 2"]
    share: Float[Array | np.ndarray, "*frames rays"]
    known: Bool[Array | np.ndarray, "*frames rays"]


@cached_jit
def find_contacts(
    cameras: Cameras,
    lines: SightLines,
    images: DistanceImages,
    middles: Float[Array | np.ndarray, "frames 3"],
) -> Contacts:
    """Find the contacts of some frames.

    Args:
        cameras: The rig.
        lines: Rays, with a leading axis ``frames``.
        images: Distances to the silhouettes of the same frames.
        middles: Middle of the person in each frame (world, m).
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
    """Where rays enter and leave the ball of radius `_REACH` around the origin (m); their nearest point if never."""
    middle = -(starts * directions).sum(-1)
    half = jnp.sqrt(jnp.maximum(_REACH**2 - (starts**2).sum(-1) + middle**2, 0.0))
    return jnp.maximum(middle - half, 1e-3), jnp.maximum(middle + half, 2e-3)
