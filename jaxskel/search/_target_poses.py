"""The initial pose of any template from its joints' places on the labelled graph (Sect. 3.3)."""

import numpy as np

from .._math.rotations import aligning
from .._math.vectors import unit
from ..body import Pose, Skeleton
from ..matching import Limbs, joint_targets, rotations_onto


def target_poses(limbs: Limbs, skeleton: Skeleton) -> Pose:
    """Turn the template's segments, from the first one outwards, so that its points come to their targets.

    The whole template is first turned as one; then each segment by the least rotation from its parent's that points its
    bone at the target. A segment without a target keeps its rest rotation to its parent.

    Args:
        limbs: Labelled limbs (m).
        skeleton: Template.

    Returns:
        One pose for each frame (m, in the limbs' world).
    """
    template, count = skeleton.template, len(limbs.paths)
    rest = np.concatenate([skeleton.rest_joints, skeleton.rest_tips])
    joints = joint_targets(limbs, skeleton)
    ends = np.where(limbs.found[..., None], limbs.ends, np.nan)
    whole, shift, _ = rotations_onto(rest[: joints.shape[1]], joints)
    rotations = np.tile(whole[:, None], (1, len(template.segment_names), 1, 1))
    places = np.full((count, len(rest), 3), np.nan)
    places[:, 0] = np.einsum("fij,j->fi", whole, rest[0]) + shift
    carriers = np.array(template.segment_of_joint + template.segment_of_tip)
    targets = np.concatenate([joints, ends], 1)
    for segment, parent in enumerate(template.segment_parents):
        own = [point for point in np.flatnonzero(carriers == segment) if point > 0]
        if segment > 0 and own:
            rotations[:, segment] = rotations[:, parent]
            start = template.point_parents[own[0]]
            goal = targets[:, own[0]] - places[:, start]
            there = np.isfinite(goal).all(1)
            bone = rotations[there, segment] @ (rest[own[0]] - rest[start])
            rotations[there, segment] = aligning(unit(bone), unit(goal[there])) @ rotations[there, segment]
        for point in own:
            start = template.point_parents[point]
            places[:, point] = places[:, start] + rotations[:, segment] @ (rest[point] - rest[start])
    return Pose(places[:, 0], rotations)
