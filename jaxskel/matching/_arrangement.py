"""Labels that geodesic distances cannot tell apart, by the arrangement of the limbs in space.

Left and right limbs, or neighbouring fingers, have equal lengths. Of all ways to exchange labels, one fits a rotated
template best: a rotation, unlike a reflection, cannot exchange left and right. This serves templates of any kind; for
humans, feet and knees say more, see `tell_sides`.
"""

from itertools import permutations

import numpy as np
from jaxtyping import Float, Int

from ..body import Skeleton
from ._descriptors import EndNodes, template_ends
from ._joint_targets import joint_targets
from ._limbs import Limbs
from ._matchers import Matches

# Only labels that geodesics leave open are tried: their mean difference from the template's distances is at most this
# share of the template's mean distance above the least.
_LEFT_OPEN = 0.15
# Difference of misfits, as a share of the template's mean distance, at which the choice is sure.
_SURE = 0.05


def arrange(
    limbs: Limbs, ends: EndNodes, matches: Matches, skeleton: Skeleton
) -> tuple[Limbs, Float[np.ndarray, " frames"]]:
    """Exchange labels so that a rotation of the template comes nearest to its joints' places on the graph.

    Returns:
        The limbs, and a confidence in the choice from 0.5 (a guess) to 1.
    """
    distances = template_ends(skeleton)
    count, scale = len(distances), float(distances.sum() / (distances.size - len(distances)))
    orders = np.array([(0, *rest) for rest in permutations(range(1, count))])
    best, sure = np.tile(np.arange(count), (len(limbs.paths), 1)), np.full(len(limbs.paths), 0.5)
    for frame in np.flatnonzero(limbs.found.all(1)):
        own = ends.distances[frame][np.ix_(matches.ends[frame], matches.ends[frame])]
        off = np.abs(own[orders[:, :, None], orders[:, None, :]] - distances).sum((1, 2)) / (count * (count - 1))
        tried = orders[off <= off.min() + _LEFT_OPEN * scale]
        rows = np.full(len(tried), frame)
        misfit = _misfits(_only(limbs, rows).reordered(tried), skeleton)
        misfit += off[off <= off.min() + _LEFT_OPEN * scale]
        ranked = np.argsort(misfit)
        best[frame] = tried[ranked[0]]
        if len(ranked) > 1:
            lead = (misfit[ranked[1]] - misfit[ranked[0]]) / (_SURE * scale)
            sure[frame] = 0.5 + 0.5 * np.tanh(lead)
        else:
            sure[frame] = 1.0
    return limbs.reordered(best), sure


def rotations_onto(
    points: Float[np.ndarray, "points 3"], targets: Float[np.ndarray, "frames points 3"]
) -> tuple[Float[np.ndarray, "frames 3 3"], Float[np.ndarray, "frames 3"], Float[np.ndarray, " frames"]]:
    """The rotation and shift that take points nearest to targets (Kabsch), and the root mean square that is left.

    Targets that are NaN do not count.
    """
    there = np.isfinite(targets).all(-1).astype(float)
    goals = np.where(there[..., None] > 0, targets, 0.0)
    total = np.maximum(there.sum(1), 1.0)[:, None]
    middle, goal = (there[..., None] * points).sum(1) / total, goals.sum(1) / total
    own = there[..., None] * (points - middle[:, None])
    other = there[..., None] * (goals - goal[:, None])
    u, _, vt = np.linalg.svd(np.einsum("fpi,fpj->fij", other, own))
    flip = np.ones((len(targets), 3))
    flip[:, 2] = np.linalg.det(u @ vt)
    rotation = u * flip[:, None] @ vt
    left = np.einsum("fij,fpj->fpi", rotation, own) - other
    shift = goal - np.einsum("fij,fj->fi", rotation, middle)
    return rotation, shift, np.sqrt((left**2).sum((1, 2)) / total[:, 0])


def _misfits(limbs: Limbs, skeleton: Skeleton) -> Float[np.ndarray, " frames"]:
    return rotations_onto(np.asarray(skeleton.rest_joints), joint_targets(limbs, skeleton))[2]


def _only(limbs: Limbs, rows: Int[np.ndarray, " rows"]) -> Limbs:
    return Limbs(limbs.paths[rows], limbs.lengths[rows], limbs.found[rows], limbs.inner[rows])
