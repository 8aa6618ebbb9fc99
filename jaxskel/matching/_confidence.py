"""Confidence in each joint of a pose that was fitted to the labelled graph, from 0 to 1."""

import numpy as np
from jaxtyping import Float

from ..body import JOINT_NAMES, TIP_PARENTS, Skeleton
from ._descriptors import template_ends
from ._limbs import END_NODE_REACH, HEAD, L_FOOT, L_HAND, R_FOOT, R_HAND, Limbs

# Errors (m) at which confidence is low: of a limb to its end node, of its path length, of the trunk to its nodes.
_END_SCALE, _WAY_SCALE, _NODE_SCALE = 0.08, 0.20, 0.10
_LIMB_OF_JOINT = {
    "head": HEAD, "l_elbow": L_HAND, "l_hand": L_HAND, "r_elbow": R_HAND, "r_hand": R_HAND,
    "l_knee": L_FOOT, "l_foot": L_FOOT, "r_knee": R_FOOT, "r_foot": R_FOOT,
}  # fmt: skip
_TRUNK = {"pelvis": "pelvis", "l_hip": "pelvis", "r_hip": "pelvis", "neck": "neck", "l_shoulder": "neck",
          "r_shoulder": "neck"}  # fmt: skip


def joint_confidence(
    joints: Float[np.ndarray, "frames joints 3"],
    tips: Float[np.ndarray, "frames tips 3"],
    limbs: Limbs,
    skeleton: Skeleton,
) -> Float[np.ndarray, "frames joints"]:
    """Confidence from 0 to 1 of the joints of poses (m, in the graphs' world) that were fitted to the labelled graph.

    A limb is trusted if its end node was found, if its path from the head through the graph is as long as the
    template's (an arm that touches the trunk has a shorter path), and if the fitted limb reaches its end node. Pelvis
    and neck are trusted if the fitted joint lies at its node.
    """
    base = joints[:, list(TIP_PARENTS)]
    reached = base + END_NODE_REACH * (tips - base)
    miss = np.linalg.norm(reached - limbs.ends, axis=-1)
    template = template_ends(skeleton)
    way = np.abs(limbs.lengths - template[0])
    limb = np.exp(-((miss / _END_SCALE) ** 2)) * np.exp(-((way / _WAY_SCALE) ** 2)) * limbs.found
    limb[:, HEAD] = np.exp(-((miss[:, HEAD] / _END_SCALE) ** 2))
    nodes = {"pelvis": limbs.pelvis, "neck": limbs.neck}
    trunk = {
        name: np.exp(-((np.linalg.norm(joints[:, JOINT_NAMES.index(name)] - node, axis=-1) / _NODE_SCALE) ** 2))
        for name, node in nodes.items()
    }
    columns = [limb[:, _LIMB_OF_JOINT[name]] if name in _LIMB_OF_JOINT else trunk[_TRUNK[name]] for name in JOINT_NAMES]
    return np.stack(columns, -1).astype(np.float32)
