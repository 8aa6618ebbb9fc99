"""Labels of any template by the arrangement of the limbs in space, where geodesic distances leave them open.

Left and right limbs, or neighbouring fingers, have equal lengths, and a spur on a limb is as far from the others as the
limb's end. Of all ways to label end nodes, one fits a rotated template best: a rotation, unlike a reflection, cannot
exchange left and right. This serves templates of any kind; for humans, feet and knees say more, see `tell_sides`.
"""

from itertools import permutations

import numpy as np
from jaxtyping import Float, Int

from ..body import Skeleton
from ..graph import SkeletalGraph, forest_of
from ._descriptors import EndNodes, template_ends
from ._joint_targets import joint_targets
from ._limbs import Limbs, paths_from_root
from ._matchers import Matches

# Only what geodesics leave open is tried: labellings whose mean difference from the template's distances is at most
# this share of the template's mean distance above that of the matcher's, and of these the best.
_LEFT_OPEN, _TRIED = 0.15, 256
# More end nodes (or tips) than this are not tried in all ways: eleven of them have 55 440.
_MOST = 12
# Difference of misfits, as a share of the template's mean distance, at which the choice is sure.
_SURE = 0.05


def arrange(
    graphs: list[SkeletalGraph], ends: EndNodes, matches: Matches, limbs: Limbs, skeleton: Skeleton
) -> tuple[Matches, Float[np.ndarray, " frames"]]:
    """Label end nodes so that geodesics agree and a rotation of the template comes nearest to its joints' places.

    Args:
        graphs: One for each frame.
        ends: Their end nodes.
        matches: Labels by geodesic distances alone. A frame that lacks a limb keeps them.
        limbs: The limbs with these labels.
        skeleton: Template.

    Returns:
        The labels, and a confidence in them from 0.5 (a guess) to 1.
    """
    distances, count = template_ends(skeleton), len(skeleton.template.tip_names)
    scale = float(distances.sum() / (distances.size - count))
    paths, lengths = paths_from_root(forest_of(graphs), np.maximum(ends.nodes, 0))
    labels, sure = matches.ends.copy(), np.full(len(graphs), 0.5)
    for frame in np.flatnonzero(limbs.found.all(1)):
        orders = _orders(ends, matches, frame, count)
        own = ends.distances[frame]
        off = np.zeros(len(orders))
        for one in range(count):
            for other in range(one):
                off += np.abs(own[orders[:, one], orders[:, other]] - distances[one, other])
        off *= 2 / (count * (count - 1))
        tried = np.argsort(off, kind="stable")[:_TRIED]
        tried = tried[off[tried] <= off[tried[0]] + _LEFT_OPEN * scale]
        rows, chosen = np.full(len(tried), frame), orders[tried]
        there = np.ones(chosen.shape, bool)
        made = Limbs(paths[rows[:, None], chosen], lengths[rows[:, None], chosen], there, limbs.inner[rows])
        cost = off[tried] + _misfits(made, skeleton)
        ranked = np.argsort(cost, kind="stable")
        labels[frame] = chosen[ranked[0]]
        lead = np.inf if len(ranked) == 1 else (cost[ranked[1]] - cost[ranked[0]]) / (_SURE * scale)
        sure[frame] = 0.5 + 0.5 * np.tanh(lead)
    return Matches(labels, matches.cost), sure


def _orders(ends: EndNodes, matches: Matches, frame: int | np.integer, count: int) -> Int[np.ndarray, "orders labels"]:
    """All ways to label the end nodes of a frame, the root first; of very many, those that the matcher has found."""
    nodes = range(1, ends.count[frame]) if ends.count[frame] <= _MOST else matches.ends[frame, 1:].tolist()
    return np.array([(0, *rest) for rest in permutations(nodes, count - 1)])


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
