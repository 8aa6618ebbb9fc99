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
    hidden: UInt8[np.ndarray, "frames cams h w8"] | None = None,
) -> Observed:
    """Observations from graph and outlines, and the recording's own data, of the frames with a person (one or more)."""
    own = silhouettes[seen.frames], cameras, seen.empty_views[seen.frames]
    others = None if hidden is None else hidden[seen.frames]
    possible = own[0] if others is None else own[0] | others
    # Carving allows few misses, because they make a hull fat; here the outlines limit how thick the body is.
    distances = silhouette_distances(possible, *own[1:], misses + 1 if misses else 0)
    outlines = contours(*own, 2 * RAYS if misses else RAYS, others)
    if misses:
        outlines = credible(outlines, distances, middles, (~own[2]).sum(1), RAYS)
    return Observed(limbs.paths, limbs.found, limbs.inner, outlines, distances, data)
