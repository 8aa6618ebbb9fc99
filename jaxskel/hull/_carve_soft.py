"""Differentiable space carving: a sigmoid of the signed distance to each outline replaces the pixel test of `carve`."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..outlines import SilhouetteDistances

# Log-probability of an impossible event: finite, because combining infinities gives NaN gradients.
_NEVER = -1e30


def carve_soft(
    distances: SilhouetteDistances,
    points: Float[Array | np.ndarray, "points 3"],
    temperature: Float[Array | np.ndarray, ""] | float,
    max_misses: int = 0,
    min_views: int = 2,
) -> Float[Array, " points"]:
    """Soft occupancy of points in one frame: the product of ``sigmoid(-distance / temperature)`` over the cameras.

    Differentiable with respect to the points, the temperature, the distance images and the cameras (K, R, t, dist),
    which are fields of ``distances``. As the temperature goes to zero, it tends to the occupancy of [`carve`][]. A
    camera that does not see a point, and an empty view, contribute a factor of one. So the occupancy jumps where a
    point enters an image, and the gradient does not show it.

    Handles one frame; vmap it over frames. Memory grows with cameras times points.

    Args:
        distances: Distances of one frame, see [`silhouette_distances`][].
        points: Points in the cameras' world (m), such as `VoxelGrid.centres`.
        temperature: Blur of the outline (m, at the depth of the point), above zero. In metres, so that it does not
            depend on the distance and resolution of a camera; half a voxel's edge is a usual start.
        max_misses: k-of-n voting: the result is the probability that at most this many cameras miss the point, with
            independent misses. For 0 it is the product.
        min_views: A point seen by fewer cameras is not occupied, because nothing bounds it. Empty views count.

    Returns:
        Occupancy of the points, from 0 to 1.
    """
    seen, distance = distances.seen_at(jnp.asarray(points))
    known = seen & ~distances.empty_views[:, None]
    # Mask unknown values before the division, so that they have no gradient.
    z = jnp.where(known, distance, 0.0) / temperature
    hits = jnp.where(known, jax.nn.log_sigmoid(-z), 0.0)
    misses = jnp.where(known, jax.nn.log_sigmoid(z), _NEVER)

    # Row k: log-probability that exactly k of the cameras so far miss a point.
    def one_more(
        exactly: Float[Array, "misses points"], view: tuple[Float[Array, " points"], Float[Array, " points"]]
    ) -> tuple[Float[Array, "misses points"], None]:
        hit, miss = view
        one_less = jnp.concatenate([jnp.full_like(exactly[:1], _NEVER), exactly[:-1]])
        return jnp.logaddexp(exactly + hit[None], one_less + miss[None]), None

    start = jnp.full((max_misses + 1, z.shape[1]), _NEVER, z.dtype).at[0].set(0.0)
    exactly, _ = jax.lax.scan(one_more, start, (hits, misses))
    total = jax.nn.logsumexp(exactly, axis=0)
    total = jnp.where(total > 0.0, 0.0, total)  # rounding may exceed zero
    return jnp.where(seen.sum(0) >= min_views, jnp.exp(total), 0.0)
