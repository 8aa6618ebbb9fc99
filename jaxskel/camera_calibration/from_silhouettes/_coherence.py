"""Silhouette coherence: every ray through an outline touches the visual hull of all other silhouettes.

A body point lies on the ray of an outline pixel, and all other views see it inside their silhouettes. So the largest
signed distance to the silhouettes, minimised along the ray, is zero or less for exact cameras and masks; otherwise it
tells by how many pixels the silhouettes miss each other. Only positive values are evidence, since a ray may run deep
through the visual hull of the other views, which is larger than the body.

After C. Hernandez, F. Schmitt, R. Cipolla: Silhouette Coherence for Camera Calibration under Circular Motion,
PAMI 2007.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from ..._math.rotations import turned
from ..._runtime.compile_cache import cached_jit
from ...cameras import Cameras, ExtrinsicChange, on_images, optical_centres
from ._contacts import Contacts
from ._distance_images import DistanceImages
from ._sight_lines import SightLines

NOTHING = -1e3
"""Residual of a ray without evidence (px): deep inside."""


class Sensitivity(eqx.Module):
    """Residuals, linearised in the changes of the extrinsics.

    Attributes:
        value: Residuals at zero change (px).
        slopes: Derivatives by the rotation vector (px/rad) and the shift (px/m) of each camera.
    """

    value: Float[Array, " rays"]
    slopes: Float[Array, "rays cams 6"]


@cached_jit
def coherence(
    change: ExtrinsicChange, cameras: Cameras, lines: SightLines, images: DistanceImages, contacts: Contacts
) -> Float[Array, "frames rays"]:
    """How far each ray misses the silhouettes that decide on it (px); negative if it meets them.

    Smooth in the change; `contacts` stay frozen, and need not have been found for the changed rig.
    """
    rays = _flat(cameras, lines, images, contacts)
    each = jnp.concatenate([jnp.asarray(change.rotation), jnp.asarray(change.shift)], -1)[rays.cameras]
    return _values(each, cameras, images, rays).reshape(contacts.depth.shape)


@cached_jit
def sensitivity(cameras: Cameras, lines: SightLines, images: DistanceImages, contacts: Contacts) -> Sensitivity:
    """Values of `coherence` without a change, and their derivatives."""
    rays = _flat(cameras, lines, images, contacts)
    each = jnp.zeros((*rays.cameras.shape, 6))
    value, back = jax.vjp(lambda e: _values(e, cameras, images, rays), each)
    # Each ray has separate changes of its three cameras, so one vector-Jacobian product gives all derivatives.
    (slopes,) = back(jnp.ones_like(value))
    every = jnp.arange(len(value), dtype=jnp.int32)[:, None]
    own = jnp.zeros((len(value), len(cameras), 6)).at[every, rays.cameras].add(slopes)
    return Sensitivity(value, own)


class _Rays(eqx.Module):
    """Rays of all frames, flattened.

    Attributes:
        cameras: The camera of the ray, and those of its two judges.
        images: Distance images of the two judges.
    """

    directions: Float[Array, "rays 3"]
    depth: Float[Array, " rays"]
    cameras: Int[Array, "rays 3"]
    images: Int[Array, "rays 2"]
    share: Float[Array, " rays"]
    tells: Bool[Array, " rays"]


def _flat(cameras: Cameras, lines: SightLines, images: DistanceImages, contacts: Contacts) -> _Rays:
    frames, count = contacts.depth.shape
    frame = jnp.repeat(jnp.arange(frames, dtype=jnp.int32), count)
    lines, contacts = jax.tree.map(lambda a: jnp.asarray(a).reshape(-1, *a.shape[2:]), (lines, contacts))
    return _Rays(
        directions=jnp.asarray(lines.directions),
        depth=jnp.asarray(contacts.depth),
        cameras=jnp.concatenate([jnp.asarray(lines.camera)[:, None], contacts.judges], 1),
        images=frame[:, None] * len(cameras) + contacts.judges,
        share=jnp.asarray(contacts.share),
        tells=jnp.asarray(lines.there) & contacts.known,
    )


def _values(
    each: Float[Array, "rays 3 6"], cameras: Cameras, images: DistanceImages, rays: _Rays
) -> Float[Array, " rays"]:
    """Residuals for changes of the three cameras of each ray (px)."""
    R = turned(each[..., :3], jnp.asarray(cameras.R)[rays.cameras])
    centres = optical_centres(cameras)[rays.cameras] + each[..., 3:]
    points = centres[:, 0] + jnp.einsum("rji,rj->ri", R[:, 0], rays.directions) * rays.depth[:, None]

    def judged(judge: int) -> Float[Array, " rays"]:
        seen = jnp.einsum("rij,rj->ri", R[:, 1 + judge], points - centres[:, 1 + judge])
        # Index the rig by ray: one camera for each ray.
        own = jax.tree.map(lambda a: jnp.asarray(a)[rays.cameras[:, 1 + judge]], cameras)
        u, v = on_images(own, *(seen[:, axis, None] for axis in range(3)))
        return images.at(rays.images[:, judge], u[:, 0], v[:, 0])[0]

    value = rays.share * judged(0) + (1 - rays.share) * judged(1)
    return jnp.where(rays.tells, value, NOTHING)
