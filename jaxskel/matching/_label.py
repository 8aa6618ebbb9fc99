"""The labelled skeletal graph: which end node is which limb, where neck and pelvis are, and which side is left."""

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
        graphs: One a frame.
        skeleton: The template.
        matcher: Which end node is which limb.
        descriptor: Labels whose geodesic distances describe neck and pelvis (Eq. 5).

    Returns:
        The limbs, the facing direction, and the confidence in left and right.
    """
    ends = describe_ends(graphs)
    matches = matcher.match(ends, skeleton)
    return tell_sides(label_limbs(graphs, ends, matches, skeleton, descriptor), skeleton)
