"""The labelled skeletal graph (Fig. 2b): limbs of the end nodes, neck and pelvis, left and right."""

import numpy as np
from jaxtyping import Float

from ..body import Skeleton
from ..graph import SkeletalGraph
from ._descriptors import describe_ends
from ._limbs import Limbs, label_limbs
from ._matchers import Matcher
from ._sides import tell_sides


def labelled_limbs(
    graphs: list[SkeletalGraph], skeleton: Skeleton, matcher: Matcher, descriptor: tuple[int, ...]
) -> tuple[Limbs, Float[np.ndarray, "frames 3"], Float[np.ndarray, " frames"]]:
    """Match the end nodes, find neck and pelvis, tell left from right (Sect. 3.2, 3.3).

    Args:
        graphs: One graph per frame.
        skeleton: The template.
        matcher: Assigns limbs to end nodes.
        descriptor: Labels whose geodesic distances describe neck and pelvis (Eq. 5).

    Returns:
        The limbs (m, in the graphs' world), the facing direction (unit), and the confidence in the sides (0.5 to 1).
    """
    ends = describe_ends(graphs)
    matches = matcher.match(ends, skeleton)
    return tell_sides(label_limbs(graphs, ends, matches, skeleton, descriptor), skeleton)
