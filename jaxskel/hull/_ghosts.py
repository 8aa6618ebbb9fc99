"""Ghosts: empty parts of a hull that remain because too few cameras carve them away."""

import numpy as np
from jaxtyping import Bool, UInt8

from ..cameras import Cameras
from ..recording import unpack_silhouettes
from ._reproject import reproject
from ._visual_hulls import VisualHulls

# A body is not alone if it leaves this share of a silhouette uncovered. A person of a third of the volume has 0.45 of
# the silhouette, which is 0.3 of both, partly hidden behind the first. Calibration errors leave a few hundredths.
_OWN_SHARE = 0.1


def explains_silhouettes(
    hulls: VisualHulls,
    frame: int,
    body: Bool[np.ndarray, " n"],
    silhouettes: UInt8[np.ndarray, "cams h w8"],
    cameras: Cameras,
    empty_views: Bool[np.ndarray, " cams"],
) -> bool:
    """Whether one body alone covers as much of the silhouettes as the whole hull does.

    A second person has a silhouette of their own in some view. A ghost has none: it lies where lines of sight through
    the silhouettes of one person cross a second time.

    Args:
        hulls: Hulls as carved.
        frame: Index of the frame in `hulls`.
        body: Mask of the voxels that belong to the body.
        silhouettes: Packed bits of that frame.
        cameras: The rig, in the hulls' world.
        empty_views: Views that show no person.
    """
    masks = unpack_silhouettes(silhouettes, 8 * silhouettes.shape[2])
    alone = VisualHulls(hulls.voxels, body[None], hulls.grid)
    covered, by_body = (
        reproject(part, number, cameras, *masks.shape[1:]) & masks for part, number in ((hulls, frame), (alone, 0))
    )
    areas = np.maximum(masks.sum((1, 2)), 1)
    return bool((((covered & ~by_body).sum((1, 2)) / areas)[~empty_views] < _OWN_SHARE).all())
