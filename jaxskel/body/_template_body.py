"""A body of any template: one ball around each joint and tip, one capsule around each bone."""

import numpy as np
from jaxtyping import Float, Int

from ._skeleton import Skeleton, rest_origins

_SLIM = 0.03  # radius where the template says none, as a share of the size: of a forearm of an adult


def balls_of_points(
    skeleton: Skeleton,
) -> tuple[
    Int[np.ndarray, " points"], Float[np.ndarray, "points 3"], Float[np.ndarray, " points"], Int[np.ndarray, "bones 2"]
]:
    """Segments, offsets from their origins (m), radii (m) and links of the balls around joints, then tips."""
    template = skeleton.template
    points = np.concatenate([skeleton.rest_joints, skeleton.rest_tips])
    segments = template.segments_of_points
    shares = np.full(len(points), _SLIM) if template.radii is None else np.array(template.radii)
    links = np.stack([template.point_parents[1:], np.arange(1, len(points), dtype=np.int32)], 1)
    return segments, points - np.asarray(rest_origins(skeleton))[segments], skeleton.size * shares, links
