"""The stature of an unknown subject, from the skeletal graphs of a few frames."""

from collections.abc import Sequence

import numpy as np

from ..body import Skeleton, default_adult
from ..graph import SkeletalGraph
from ._descriptors import template_geodesics


def estimate_stature(graphs: Sequence[SkeletalGraph], template: Skeleton | None = None) -> float | None:
    """Standing height (m) of a template of such a size that its way from head to feet is as long as in the graphs.

    The two end nodes farthest from the head are the feet in most poses; the median over the frames forgives the rest.

    Args:
        graphs: Pruned graphs of one subject, rooted at the top of the head.
        template: Of any size; by default the default adult.

    Returns:
        The stature, or None where no graph has two limbs.
    """
    template = template or default_adult()
    way = template_geodesics(template)[15, 3:].mean()
    lengths = []
    for graph in graphs:
        ends = graph.end_nodes
        if len(ends) >= 3:
            lengths.append(graph.depths[ends[-2:]].mean())
    return float(np.median(lengths) / way * template.stature) if lengths else None
