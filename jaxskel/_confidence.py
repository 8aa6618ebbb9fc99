"""How far to trust each joint of a pose, from 0 to 1."""

import numpy as np
from jaxtyping import Float

from ._descriptors import template_ends
from ._limbs import END_NODE_REACH, HEAD, L_FOOT, L_HAND, R_FOOT, R_HAND, Limbs
from ._skeleton import JOINT_NAMES, TIP_PARENTS, Skeleton

# A limb this far (m) from its end node, or with a way from the head wrong by so much, is not to be trusted.
_END_SCALE, _WAY_SCALE, _NODE_SCALE = 0.08, 0.20, 0.10
_LIMB_OF_JOINT = {
    "head": HEAD, "l_elbow": L_HAND, "l_hand": L_HAND, "r_elbow": R_HAND, "r_hand": R_HAND,
    "l_knee": L_FOOT, "l_foot": L_FOOT, "r_knee": R_FOOT, "r_foot": R_FOOT,
}  # fmt: skip
_TRUNK = {"pelvis": "pelvis", "l_hip": "pelvis", "r_hip": "pelvis", "neck": "neck", "l_shoulder": "neck",
          "r_shoulder": "neck"}  # fmt: skip


# A hypothesis that costs so much more counts for a third as much; a pose that costs so much more than is dear
# likewise, in the units of `volume_objective`.
_RIVAL_COST, _EXCESS_COST = 4.0, 20.0
# Joints this near to each other are in the same place (m), as in the paper's Table 1.
_SAME_PLACE = 0.1


def searched_confidence(
    joints: Float[np.ndarray, "frames hypotheses joints=15 3"],
    cost: Float[np.ndarray, "frames hypotheses"],
    dear: float,
) -> Float[np.ndarray, "frames joints=15"]:
    """Confidence in the first hypothesis of each frame: do its rivals put a joint elsewhere, is it suspiciously dear?

    Args:
        joints: Of all hypotheses (m).
        cost: Of all hypotheses.
        dear: What a pose of this subject hardly ever costs, see `dear` in `_solve`.
    """
    there = np.linalg.norm(joints - joints[:, :1], axis=-1) < _SAME_PLACE
    weight = np.exp(-np.clip(cost - cost[:, :1], -50.0, None) / _RIVAL_COST)
    agreeing = (weight[..., None] * there).sum(1) / weight.sum(1)[:, None]
    excess = np.maximum(cost[:, :1] - dear, 0.0)
    return np.clip(agreeing * np.exp(-excess / _EXCESS_COST), 0.0, 1.0).astype(np.float32)


def joint_confidence(
    joints: Float[np.ndarray, "frames joints=15 3"],
    tips: Float[np.ndarray, "frames tips=5 3"],
    limbs: Limbs,
    skeleton: Skeleton,
) -> Float[np.ndarray, "frames joints=15"]:
    """Confidence of the joints of poses that follow the labelled graph.

    A limb is trusted if its end node was found, if the way from the head to it through the body is as long as the
    template's (an arm that touches the trunk has a short cut) and if the fitted limb reaches it. Pelvis and neck are
    trusted if the fitted joint lies at its node.
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
