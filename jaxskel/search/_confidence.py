"""How far to trust each joint of a pose that was searched for, from 0 to 1."""

import numpy as np
from jaxtyping import Float

# A hypothesis that costs so much more counts for a third as much; a pose that costs so much more than is dear
# likewise, in the units of `volume_objective`.
_RIVAL_COST, _EXCESS_COST = 4.0, 20.0
# Joints this near to each other are in the same place (m), as in the paper's Table 1.
_SAME_PLACE = 0.1


def searched_confidence(
    joints: Float[np.ndarray, "frames hypotheses joints=15 3"],
    cost: Float[np.ndarray, "frames hypotheses"],
    cost_threshold: float,
) -> Float[np.ndarray, "frames joints=15"]:
    """Confidence in the first hypothesis of each frame: do its rivals put a joint elsewhere, is it suspiciously dear?

    Args:
        joints: Of all hypotheses (m).
        cost: Of all hypotheses.
        cost_threshold: What a pose of this subject hardly ever costs, see `cost_threshold` in `_search`.
    """
    there = np.linalg.norm(joints - joints[:, :1], axis=-1) < _SAME_PLACE
    weight = np.exp(-np.clip(cost - cost[:, :1], -50.0, None) / _RIVAL_COST)
    agreeing = (weight[..., None] * there).sum(1) / weight.sum(1)[:, None]
    excess = np.maximum(cost[:, :1] - cost_threshold, 0.0)
    return np.clip(agreeing * np.exp(-excess / _EXCESS_COST), 0.0, 1.0).astype(np.float32)
