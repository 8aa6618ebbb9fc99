"""Size of an unknown subject, estimated from the skeletal graphs of a few frames."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ..body import Skeleton, default_adult
from ..graph import SkeletalGraph
from ._descriptors import template_ends
from ._limbs import END_NODE_REACH, L_FOOT, R_FOOT, Limbs


def estimate_stature(graphs: Sequence[SkeletalGraph], template: Skeleton | None = None) -> float | None:
    """Standing height (m) of the scaled template whose path from head to feet is as long as in the graphs.

    The two end nodes farthest from the head are the feet in most poses; the median over the frames tolerates others.

    Args:
        graphs: Pruned graphs of one subject, rooted at the top of the head.
        template: Template of any size; by default the default adult.

    Returns:
        The stature (m), or None if no graph has two limbs.
    """
    template = template or default_adult()
    way = template_ends(template)[0, [L_FOOT, R_FOOT]].mean()
    lengths = []
    for graph in graphs:
        ends = graph.end_nodes
        if len(ends) >= 3:
            lengths.append(graph.depths[ends[-2:]].mean())
    return float(np.median(lengths) / way * template.stature) if lengths else None


def estimate_size(graphs: Sequence[SkeletalGraph], template: Skeleton) -> float | None:
    """Size of a subject over that of a template of any kind, by the lengths of its limbs; None if no graph has them.

    The farthest end nodes are taken for the limbs; the median over the frames tolerates others.
    """
    ways = _ways(template)
    found = [graph.depths[graph.end_nodes[-len(ways) :]].mean() for graph in graphs if len(graph.end_nodes) > len(ways)]
    return float(np.median(found) / ways.mean()) if found else None


def size_of_limbs(limbs: Limbs, template: Skeleton) -> float:
    """As `estimate_size`, by labelled limbs, of which no spur is one; 1 where none is found."""
    found = limbs.found[:, 1:]
    return float(np.median((limbs.lengths[:, 1:] / _ways(template))[found])) if found.any() else 1.0


def _ways(template: Skeleton) -> Float[np.ndarray, " limbs"]:
    """Distances from the template's root to its end nodes, which lie short of the tips (m)."""
    short = (1 - END_NODE_REACH) * template.tip_lengths
    return template_ends(template)[0, 1:] - short[1:] - short[0]
