"""Distances of points to tapered capsules, smooth in everything: the measure behind the volume terms."""

import jax.numpy as jnp
from jaxtyping import Array, Float

_SMALL = 1e-8  # the root of zero has no gradient; a tenth of a millimetre is nothing here


def capsule_distance(
    points: Float[Array, "*batch 3"], ends: Float[Array, "*batch 2 3"], radii: Float[Array, "*batch 2"]
) -> Float[Array, "*batch"]:
    """Signed distance of each point to its capsule (m), negative inside.

    The radius is taken at the foot of the perpendicular on the axis, which is exact for a cylinder and off by the
    square of the taper otherwise: under a millimetre on a body.
    """
    start, along = ends[..., 0, :], ends[..., 1, :] - ends[..., 0, :]
    part = ((points - start) * along).sum(-1) / ((along * along).sum(-1) + 1e-9)
    part = jnp.clip(part, 0.0, 1.0)
    away = points - start - part[..., None] * along
    distance = jnp.sqrt((away * away).sum(-1) + _SMALL)
    return distance - radii[..., 0] * (1 - part) - radii[..., 1] * part


def all_distances(
    points: Float[Array, "points 3"], ends: Float[Array, "capsules 2 3"], radii: Float[Array, "capsules 2"]
) -> Float[Array, "points capsules"]:
    """Signed distance of every point to every capsule (m), as two matrix products."""
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    squared = (along * along).sum(-1) + 1e-9
    # About the mean of the points, because float32 loses digits far from the origin.
    middle = points.mean(0)[None]
    points, start = points - middle, start - middle
    dot = points @ along.T - (start * along).sum(-1)[None]
    part = jnp.clip(dot / squared[None], 0.0, 1.0)
    near = (points * points).sum(-1)[:, None] - 2 * points @ start.T + (start * start).sum(-1)[None]
    near = near - 2 * part * dot + part * part * squared[None]
    radius = radii[:, 0][None] * (1 - part) + radii[:, 1][None] * part
    return jnp.sqrt(jnp.maximum(near, 0.0) + _SMALL) - radius
