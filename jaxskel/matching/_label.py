"""The labelled skeletal graph (Fig. 2b): limbs of the end nodes, inner nodes, left and right."""

import numpy as np
from jaxtyping import Float

from ..body import HUMAN_15, Skeleton
from ..graph import SkeletalGraph
from ._arrangement import arrange
from ._descriptors import describe_ends
from ._limbs import Limbs, label_limbs
from ._matchers import Matcher
from ._sides import tell_sides


def labelled_limbs(
    graphs: list[SkeletalGraph], skeleton: Skeleton, matcher: Matcher, descriptor: tuple[int, ...]
) -> tuple[Limbs, Float[np.ndarray, "frames 3"], Float[np.ndarray, " frames"]]:
    """Match the end nodes, find the inner joints, tell left from right (Sect. 3.2, 3.3).

    Args:
        graphs: One graph per frame.
        skeleton: The template.
        matcher: Assigns limbs to end nodes.
        descriptor: Labels whose geodesic distances describe a human's neck and pelvis (Eq. 5); other templates say
            that themselves.

    Returns:
        The limbs (m, in the graphs' world), the facing direction of humans (unit; zero if unknown), and the confidence
        in the sides (0.5 to 1).
    """
    ends = describe_ends(graphs)
    matches = matcher.match(ends, skeleton)
    if skeleton.template == HUMAN_15:
        return tell_sides(label_limbs(graphs, ends, matches, skeleton, descriptor), skeleton)
    limbs = label_limbs(graphs, ends, matches, skeleton, skeleton.template.described_by)
    limbs, sides = arrange(limbs, ends, matches, skeleton)
    return limbs, np.zeros((len(graphs), 3)), sides
