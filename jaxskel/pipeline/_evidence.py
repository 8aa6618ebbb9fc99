"""Observations for the objectives: the labelled graph, the outlines and the hull of each person."""

import numpy as np
from jaxtyping import Array, Float, UInt8

from ..cameras import Cameras
from ..hull import Seen
from ..matching import Limbs
from ..outlines import RAYS, contours, credible, silhouette_distances
from ..refinement.terms import Observed


def observed_graph(limbs: Limbs, data: dict[str, Float[Array | np.ndarray, "people ..."]]) -> Observed:
    """Observations from the labelled graph, and the recording's own data."""
    return Observed(limbs.paths, limbs.found, limbs.inner, data=data)


def observed_volume(
    limbs: Limbs,
    seen: Seen,
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    middles: Float[np.ndarray, "people 3"],
    misses: int,
    data: dict[str, Float[Array | np.ndarray, "people ..."]],
) -> Observed:
    """Observations from graph and outlines, and the recording's own data, of the frames with a person (one or more)."""
    own = silhouettes[seen.frames], cameras, seen.empty_views[seen.frames]
    # Carving allows few misses, because they make a hull fat; here the outlines limit how thick the body is.
    distances = silhouette_distances(*own, misses + 1 if misses else 0)
    outlines = contours(*own, 2 * RAYS if misses else RAYS)
    if misses:
        outlines = credible(outlines, distances, middles, (~own[2]).sum(1), RAYS)
    return Observed(limbs.paths, limbs.found, limbs.inner, outlines, distances, data)
