"""Which outlines to believe: the others know where the person may end, and where not."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._runtime.batching import single_precision
from .._runtime.compile_cache import cached_jit
from ._distances import SilhouetteDistances
from ._rays import Contours

# Along each ray silhouettes are looked up at these distances from the middle of the person (m).
_PLACES = np.linspace(-1.2, 1.2, 49, dtype=np.float32)
# The view that a ray comes from says nothing of it, and another one may err.
_PASSED_OVER = 2
# A ray that comes deeper than this into what the others see is of a hole: views to both sides see the outline of a
# trunk so thick (m) as well inside as their directions differ, and some more.
_TRUNK, _DEEPER = 0.18, 0.005
# A ray that comes nowhere as near as this to what the others see is of a blob (m).
_FARTHEST = 0.025


def credible(
    outlines: Contours,
    silhouettes: SilhouetteDistances,
    middles: Float[np.ndarray, "frames 3"],
    views: Int[np.ndarray, " frames"],
    count: int,
) -> Contours:
    """Of the outlines of some frames those that agree with all views but two, so many of each frame.

    A true outline's ray grazes the person. The outline of a hole in a mask runs through what the other views see as
    well inside; the outline of a blob, through what they do not see at all.

    Args:
        outlines: Rays, in no order.
        silhouettes: Distances to the silhouettes of the same frames.
        middles: Middle of each person (m).
        views: How many views see each person.
        count: Number of rays of each frame that are given back; where fewer are credible, some are given twice.
    """
    deepest = _DEEPER + _TRUNK * (1 - np.cos(2 * np.pi / np.maximum(views, 4)))
    given = single_precision((outlines, silhouettes, middles, deepest))
    chosen = np.zeros((len(middles), count), int)
    for frame in range(len(middles)):
        good = np.flatnonzero(_grazing(*jax.tree.map(lambda a, i=frame: a[i], given)))
        chosen[frame] = np.resize(good, count) if len(good) else np.arange(count)
    rows = np.arange(len(middles))[:, None]
    return jax.tree.map(lambda a: a[rows, chosen], outlines)


@cached_jit
def _grazing(
    outlines: Contours, silhouettes: SilhouetteDistances, middle: Float[Array, "3"], deepest: Float[Array, ""]
) -> Bool[Array, " rays"]:
    centres, directions = jnp.asarray(outlines.centres), jnp.asarray(outlines.directions)
    nearest = ((middle[None] - centres) * directions).sum(1)
    points = centres[:, None] + directions[:, None] * (nearest[:, None] + _PLACES[None])[..., None]
    out = silhouettes.near(points.reshape(-1, 3))

    def inserted(view: Array, largest: tuple[Array, ...]) -> tuple[Array, ...]:
        new, ordered = out[view], []
        for value in largest:
            ordered.append(jnp.maximum(value, new))
            new = jnp.minimum(value, new)
        return tuple(ordered)

    largest = (jnp.full(out.shape[1], -jnp.inf, out.dtype),) * (_PASSED_OVER + 1)
    away = jax.lax.fori_loop(0, len(out), inserted, largest)[-1].reshape(len(centres), -1).min(1)
    return (away > -deepest) & (away < _FARTHEST)
