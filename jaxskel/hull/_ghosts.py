"""Ghosts: parts of a hull that are there only because too few cameras see that nobody is."""

import numpy as np
from jaxtyping import Bool, UInt8

from ..cameras import Cameras
from ..recording import unpack_silhouettes
from ._reproject import reproject
from ._visual_hulls import VisualHulls

# Share of a silhouette that somebody else must be needed for. One of a third of a person's volume has 0.45 of his
# silhouette, which is 0.3 of both; some of it is hidden behind him. Calibrations that are off leave a few hundredths.
_OWN_SHARE = 0.1


def explains_silhouettes(
    hulls: VisualHulls,
    frame: int,
    body: Bool[np.ndarray, " n"],
    silhouettes: UInt8[np.ndarray, "cams h w8"],
    cameras: Cameras,
    empty_views: Bool[np.ndarray, " cams"],
) -> bool:
    """Whether one body of a hull alone covers what the whole hull covers of the silhouettes.

    A second person has a silhouette of his own in some view. A ghost, where lines of sight through the silhouettes of
    one person cross a second time, has none.

    Args:
        hulls: As carved.
        frame: One of them.
        body: Which voxels of the hulls belong to the body.
        silhouettes: Of that frame, packed.
        cameras: In the hulls' world.
        empty_views: Views that show no person.
    """
    masks = unpack_silhouettes(silhouettes, 8 * silhouettes.shape[2])
    alone = VisualHulls(hulls.voxels, body[None], hulls.grid)
    covered, by_body = (
        reproject(part, number, cameras, *masks.shape[1:]) & masks for part, number in ((hulls, frame), (alone, 0))
    )
    areas = np.maximum(masks.sum((1, 2)), 1)
    return bool((((covered & ~by_body).sum((1, 2)) / areas)[~empty_views] < _OWN_SHARE).all())
