"""Where the joints of a template are on a labelled graph: at their geodesic distances from its end nodes."""

import numpy as np
from jaxtyping import Float

from ..body import Skeleton
from ._descriptors import template_geodesics
from ._limbs import END_NODE_REACH, Limbs


def joint_targets(limbs: Limbs, skeleton: Skeleton) -> Float[np.ndarray, "frames joints 3"]:
    """Points of the graph for the joints that lie on it (m, in the graphs' world); NaN for the others.

    Inner joints are at their nodes (Eq. 6). Joints whose bones are attracted to a path are on that path, as far from
    its end node, or from the root if that is nearer, as the template's joint is from the tip.
    """
    template, geodesics = skeleton.template, template_geodesics(skeleton)
    found = np.full((len(limbs.paths), len(template.joint_names), 3), np.nan)
    # End nodes lie short of the tips.
    short = (1 - END_NODE_REACH) * skeleton.tip_lengths
    for bone in template.attracted:
        to_tip, to_root = geodesics[bone.joint, [bone.tip, 0]] - short[[bone.tip, 0]]
        length = limbs.lengths[:, bone.tip]
        distance = np.full_like(length, to_tip) if to_tip < to_root else length - to_root
        there = limbs.found[:, bone.tip]
        found[there, bone.joint] = limbs.at(np.array([bone.tip]), distance[:, None])[there, 0]
    found[:, list(template.inner)] = limbs.inner
    return found
