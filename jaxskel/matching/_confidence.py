"""Confidence in each joint of a pose that was fitted to the labelled graph, from 0 to 1."""

from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from ..body import Skeleton, SkeletonTemplate
from ._descriptors import template_ends
from ._limbs import END_NODE_REACH, Limbs

# Errors (m) at which confidence is low: of a limb to its end node, of its path length, of the trunk to its nodes.
_END_SCALE, _WAY_SCALE, _NODE_SCALE = 0.08, 0.20, 0.10


def joint_confidence(
    joints: Float[np.ndarray, "frames joints 3"],
    tips: Float[np.ndarray, "frames tips 3"],
    limbs: Limbs,
    skeleton: Skeleton,
) -> Float[np.ndarray, "frames joints"]:
    """Confidence from 0 to 1 of the joints of poses (m, in the graphs' world) that were fitted to the labelled graph.

    A limb is trusted if its end node was found, if its path from the root through the graph is as long as the
    template's (an arm that touches the trunk has a shorter path), and if the fitted limb reaches its end node. Inner
    joints, pelvis and neck of a human, are trusted if the fitted joint lies at its node, and so are those beside them.
    """
    template = skeleton.template
    base = joints[:, list(template.tip_parents)]
    reached = base + END_NODE_REACH * (tips - base)
    miss = np.linalg.norm(reached - limbs.ends, axis=-1)
    way = np.abs(limbs.lengths - template_ends(skeleton)[0])
    limb = np.exp(-((miss / _END_SCALE) ** 2)) * np.exp(-((way / _WAY_SCALE) ** 2)) * limbs.found
    limb[:, 0] = np.exp(-((miss[:, 0] / _END_SCALE) ** 2))
    off = np.linalg.norm(joints[:, list(template.inner)] - limbs.inner, axis=-1)
    trust = np.concatenate([limb, np.exp(-((off / _NODE_SCALE) ** 2))], 1)
    return trust[:, _told_by(template)].astype(np.float32)


@lru_cache(maxsize=16)
def _told_by(template: SkeletonTemplate) -> Int[np.ndarray, " joints"]:
    """What tells how good each joint is: a limb, or an inner node, which are counted after the limbs.

    A joint on the centre-line of one limb is told by that limb, every other one by the nearest inner joint above it.
    """
    limbs: list[set[int]] = [set() for _ in template.joint_names]
    for tip, joint in enumerate(template.tip_parents):
        while joint >= 0:
            limbs[joint].add(tip)
            joint = template.joint_parents[joint]
    attracted, found = {bone.joint for bone in template.attracted}, []
    for joint, parent in enumerate(template.joint_parents):
        if joint in template.inner:
            found.append(len(template.tip_names) + template.inner.index(joint))
        elif joint in attracted and len(limbs[joint]) == 1:
            found.append(next(iter(limbs[joint])))
        else:
            found.append(found[parent] if parent >= 0 else len(template.tip_names))
    return np.array(found)
