"""Space carving with a gradient: a sigmoid of the distance to each outline where `carve` looks at one pixel."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..outlines import SilhouetteDistances

# The logarithm of a probability of zero: finite, because infinities that meet have gradients of NaN.
_NEVER = -1e30


def carve_soft(
    distances: SilhouetteDistances,
    points: Float[Array | np.ndarray, "points 3"],
    temperature: Float[Array | np.ndarray, ""] | float,
    max_misses: int = 0,
    min_views: int = 2,
) -> Float[Array, " points"]:
    """Soft occupancy of points in one frame: the product of ``sigmoid(-distance / temperature)`` over the cameras.

    Differentiable by the points, the temperature, the distance images and the cameras (K, R, t, dist), which are
    fields of ``distances``. As the temperature goes to zero it becomes the occupancy that [`carve`][] gives. A camera
    that does not see a point, and a lost view, know nothing of it: their factor is one. So there is a step where a
    point enters an image, and no gradient tells of it.

    Written for one frame, to be vmapped; memory grows as cameras times points.

    Args:
        distances: Of one frame, see [`silhouette_distances`][].
        points: In the world of the cameras (m): `VoxelGrid.centres`, or any others.
        temperature: How blurred an outline is (m, at the depth of the point), above zero. In metres, so that near and
            far cameras and fine and coarse images blur alike; half a voxel's edge is a usual start.
        max_misses: k-of-n voting: the probability that at most this many cameras miss the point, as if they did so
            independently of each other. For none it is the product.
        min_views: A point seen by fewer cameras than this is not occupied: nothing bounds it. Lost views count.

    Returns:
        Occupancy of the points, from 0 to 1.
    """
    seen, distance = distances.seen_at(jnp.asarray(points))
    known = seen & ~distances.empty_views[:, None]
    # What is not known is taken out before the division, so that it has no gradient at all.
    z = jnp.where(known, distance, 0.0) / temperature
    hits = jnp.where(known, jax.nn.log_sigmoid(-z), 0.0)
    misses = jnp.where(known, jax.nn.log_sigmoid(z), _NEVER)

    # Row k: logarithm of the probability that k of the cameras so far miss a point.
    def one_more(
        exactly: Float[Array, "misses points"], view: tuple[Float[Array, " points"], Float[Array, " points"]]
    ) -> tuple[Float[Array, "misses points"], None]:
        hit, miss = view
        one_less = jnp.concatenate([jnp.full_like(exactly[:1], _NEVER), exactly[:-1]])
        return jnp.logaddexp(exactly + hit[None], one_less + miss[None]), None

    start = jnp.full((max_misses + 1, z.shape[1]), _NEVER, z.dtype).at[0].set(0.0)
    exactly, _ = jax.lax.scan(one_more, start, (hits, misses))
    total = jax.nn.logsumexp(exactly, axis=0)
    total = jnp.where(total > 0.0, 0.0, total)  # by rounding
    return jnp.where(seen.sum(0) >= min_views, jnp.exp(total), 0.0)
