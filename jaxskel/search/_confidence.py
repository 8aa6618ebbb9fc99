"""Confidence in each joint of a searched pose, from 0 to 1."""

import numpy as np
from jaxtyping import Float

# In units of `volume_objective`: excess over the best cost that divides a rival's weight by e, and excess of the best
# cost over the threshold that divides the confidence by e.
_RIVAL_COST, _EXCESS_COST = 4.0, 20.0
# Joints closer than this are in the same place (m), as in the paper's Table 1.
_SAME_PLACE = 0.1


def searched_confidence(
    joints: Float[np.ndarray, "frames hypotheses joints=15 3"],
    cost: Float[np.ndarray, "frames hypotheses"],
    cost_threshold: float,
) -> Float[np.ndarray, "frames joints=15"]:
    """Confidence in the cheapest hypothesis of each frame: low if rivals place a joint elsewhere or the cost is high.

    Args:
        joints: Joints of all hypotheses (m, in the world).
        cost: Costs of all hypotheses.
        cost_threshold: Cost that few frames of this subject exceed, see `cost_threshold` in `_search`.
    """
    there = np.linalg.norm(joints - joints[:, :1], axis=-1) < _SAME_PLACE
    weight = np.exp(-np.clip(cost - cost[:, :1], -50.0, None) / _RIVAL_COST)
    agreeing = (weight[..., None] * there).sum(1) / weight.sum(1)[:, None]
    excess = np.maximum(cost[:, :1] - cost_threshold, 0.0)
    return np.clip(agreeing * np.exp(-excess / _EXCESS_COST), 0.0, 1.0).astype(np.float32)
