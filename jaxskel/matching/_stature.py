"""Stature of an unknown subject, estimated from the skeletal graphs of a few frames."""

from collections.abc import Sequence

import numpy as np

from ..body import Skeleton, default_adult
from ..graph import SkeletalGraph
from ._descriptors import template_geodesics


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
    way = template_geodesics(template)[15, 3:].mean()
    lengths = []
    for graph in graphs:
        ends = graph.end_nodes
        if len(ends) >= 3:
            lengths.append(graph.depths[ends[-2:]].mean())
    return float(np.median(lengths) / way * template.stature) if lengths else None
