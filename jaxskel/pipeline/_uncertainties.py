"""What is known before the refinement of how far its joints may be off: from the graph, or from a search."""

from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Bool, Float

from .._math.gaussians import deviation_for
from .._runtime.batching import length_of, padded, single_precision
from ..body import JOINT_NAMES, Skeleton, place_joints
from ..matching import Limbs, joint_confidence
from ..refinement import Refined
from ..refinement.terms import Observed
from ..search import SAME_PLACE, Hypotheses, Uncertainty, cost_threshold, searched_uncertainty, turned_rivals
from ._prepared import Prepared

# Confidences beyond these say no more about how far a joint may be off.
_LEAST_TRUST, _MOST_TRUST = 0.05, 0.95


class TrustInGraph(NamedTuple):
    """Confidence by where the labelled limbs end."""

    limbs: Limbs
    skeleton: Skeleton

    def __call__(self, refined: Refined) -> Uncertainty:
        """Uncertainty of refined joints: the same in all directions, and as wide as the confidence says."""
        trust = joint_confidence(np.asarray(refined.joints), np.asarray(refined.tips), self.limbs, self.skeleton)
        variance = deviation_for(SAME_PLACE, np.clip(trust, _LEAST_TRUST, _MOST_TRUST)) ** 2
        covariance = (variance[..., None, None] * np.eye(3)).astype(np.float32)
        return Uncertainty(covariance, trust, np.ones(len(trust), np.float32))


class TrustInSearch(NamedTuple):
    """Confidence by what the hypotheses of a search cost: the arguments of `searched_uncertainty`."""

    away: Float[np.ndarray, "frames hypotheses joints 3"]
    cost: Float[np.ndarray, "frames hypotheses"]
    unusual: float
    unexplained: Float[np.ndarray, " frames"]
    clothes: float
    worn: Float[np.ndarray, " joints"] | float
    turned: Bool[np.ndarray, "frames hypotheses"]

    def __call__(self, refined: Refined) -> Uncertainty:
        """Uncertainty of refined joints, of which the covariances are those of the normal equations."""
        return searched_uncertainty(
            self.away, self.cost, np.asarray(refined.covariance), self.unusual, self.unexplained, self.clothes,
            self.worn, self.turned,
        )  # fmt: skip


def trust_in_search(
    found: Hypotheses, observed: Observed, unexplained: Float[np.ndarray, " frames"], prepared: Prepared
) -> TrustInSearch:
    """What hypotheses say of the cheapest; `observed` is on the device, `unexplained` is its share of the outlines."""
    costs = prepared.costs
    return TrustInSearch(
        _away(found, prepared.skeleton, length_of(observed)), found.cost,
        cost_threshold(None if costs is None else costs.typical), unexplained, prepared.clothes, prepared.worn,
        turned_rivals(found),
    )  # fmt: skip


def _away(found: Hypotheses, skeleton: Skeleton, at_once: int) -> Float[np.ndarray, "frames hypotheses joints 3"]:
    """Where the joints of all hypotheses are, relative to those of the first (m)."""
    count, hypotheses = found.cost.shape
    if hypotheses == 1:
        return np.zeros((count, 1, len(JOINT_NAMES), 3), np.float32)
    poses = jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:]), padded(found.poses, at_once))
    joints = np.asarray(place_joints(single_precision(skeleton), poses)[0])
    joints = joints.reshape(at_once, hypotheses, *joints.shape[1:])[:count]
    return joints - joints[:, :1]
