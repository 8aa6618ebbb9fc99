"""Selection of credible outline rays: rays of holes and blobs in a mask disagree with the other views."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._runtime.batching import single_precision
from .._runtime.compile_cache import cached_jit
from ._distances import SilhouetteDistances
from ._rays import Contours

# Positions along each ray where silhouettes are sampled, from the point nearest to the middle of the person (m).
_PLACES = np.linspace(-1.2, 1.2, 49, dtype=np.float32)
# Number of views ignored: the ray's own view is no evidence, and another one may err.
_PASSED_OVER = 2
# A ray that runs too deep inside the other silhouettes (m) belongs to a hole. The limit is how deep views to both sides
# see the outline of a trunk of this thickness, which grows with the angle between views, plus a tolerance.
_TRUNK, _DEEPER = 0.18, 0.005
# A ray that stays farther than this outside the other silhouettes belongs to a blob (m).
_FARTHEST = 0.025


def credible(
    outlines: Contours,
    silhouettes: SilhouetteDistances,
    middles: Float[np.ndarray, "frames 3"],
    views: Int[np.ndarray, " frames"],
    count: int,
) -> Contours:
    """Select, for each frame, outline rays that agree with all views but two.

    The ray of a true outline grazes the person. The ray of a hole in a mask runs deep inside the silhouettes of the
    other views; the ray of a blob stays outside of them.

    Args:
        outlines: Rays of each frame, view by view.
        silhouettes: Distances to the silhouettes of the same frames.
        middles: Middle of each person in the cameras' world (m).
        views: Number of views that see each person.
        count: Number of rays returned per frame, spread evenly over those that are credible, so that no view is left
            out; if these are fewer, some are repeated. If none is, they are spread over all.
    """
    deepest = _DEEPER + _TRUNK * (1 - np.cos(2 * np.pi / np.maximum(views, 4)))
    given = single_precision((outlines, silhouettes, middles, deepest))
    chosen = np.zeros((len(middles), count), int)
    for frame in range(len(middles)):
        grazing = np.asarray(_grazing(*jax.tree.map(lambda a, i=frame: a[i], given)))
        good = np.flatnonzero(grazing if grazing.any() else ~grazing)
        chosen[frame] = good[np.arange(count) * len(good) // count]
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
