"""The stature of an unknown subject, from the skeletal graphs of a few frames."""

from collections.abc import Sequence

import numpy as np

from ._descriptors import template_geodesics
from ._graph import SkeletalGraph
from ._skeleton import default_adult


def estimate_stature(graphs: Sequence[SkeletalGraph]) -> float | None:
    """Standing height (m) of the default adult whose way from head to feet is as long as in the graphs.

    The two end nodes farthest from the head are the feet in most poses; the median over the frames forgives the rest.

    Args:
        graphs: Pruned graphs of one subject, rooted at the top of the head.

    Returns:
        The stature, or None where no graph has two limbs.
    """
    adult = default_adult(1.0)
    template = template_geodesics(adult)[15, 3:].mean()
    lengths = []
    for graph in graphs:
        ends = graph.end_nodes
        if len(ends) >= 3:
            lengths.append(graph.depths[ends[-2:]].mean())
    return float(np.median(lengths) / template) if lengths else None
