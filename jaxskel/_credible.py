"""Which outlines to believe: the others know where the person may end, and where not."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ._contours import Contours
from ._silhouette_distances import SilhouetteDistances
from ._stacks import single_precision

# Along each ray silhouettes are looked up at these distances from the middle of the person (m).
_PLACES = np.linspace(-1.2, 1.2, 49, dtype=np.float32)
# The view that a ray comes from says nothing of it, and another one may err.
_PASSED_OVER = 2
# A ray that comes deeper than this into what the others see, or nowhere as near to it, is of a hole or a blob (m).
_DEEPEST, _FARTHEST = -0.045, 0.025


def credible(
    outlines: Contours,
    silhouettes: SilhouetteDistances,
    middles: Float[np.ndarray, "frames 3"],
    count: int,
) -> Contours:
    """Of the outlines of some frames those that agree with all views but two, so many of each frame.

    A true outline's ray grazes the person. The outline of a hole in a mask runs through what the other views see as
    well inside; the outline of a blob, through what they do not see at all.

    Args:
        outlines: Rays, in no order.
        silhouettes: Distances to the silhouettes of the same frames.
        middles: Middle of each person (m).
        count: Number of rays of each frame that are given back; where fewer are credible, some are given twice.
    """
    given = single_precision((outlines, silhouettes, middles))
    chosen = np.zeros((len(middles), count), int)
    for frame in range(len(middles)):
        good = np.flatnonzero(_grazing(*jax.tree.map(lambda a, i=frame: a[i], given)))
        chosen[frame] = np.resize(good, count) if len(good) else np.arange(count)
    rows = np.arange(len(middles))[:, None]
    return jax.tree.map(lambda a: a[rows, chosen], outlines)


@eqx.filter_jit
def _grazing(outlines: Contours, silhouettes: SilhouetteDistances, middle: Float[Array, "3"]) -> Bool[Array, " rays"]:
    centres, directions = jnp.asarray(outlines.centres), jnp.asarray(outlines.directions)
    nearest = ((middle[None] - centres) * directions).sum(1)
    points = centres[:, None] + directions[:, None] * (nearest[:, None] + _PLACES[None])[..., None]
    out = silhouettes.near(points.reshape(-1, 3))

    def without_largest(_: Array, out: Array) -> Array:
        return jnp.where(out >= out.max(0)[None], -jnp.inf, out)

    away = jax.lax.fori_loop(0, _PASSED_OVER, without_largest, out).max(0).reshape(len(centres), -1).min(1)
    return (away > _DEEPEST) & (away < _FARTHEST)
