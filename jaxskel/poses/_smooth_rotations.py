"""Low-pass filtering of poses whose rotations are known: the points go with their segments."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from .._math.rotations import aligning, nearest_rotation
from .._math.vectors import unit
from ..body import Skeleton, SkeletonTemplate


def filtered_poses(
    points: Float[np.ndarray, "frames points 3"],
    rotations: Float[np.ndarray, "frames segments 3 3"],
    skeleton: Skeleton,
    low: Callable[[np.ndarray], np.ndarray],
) -> tuple[Float[np.ndarray, "frames points 3"], Float[np.ndarray, "frames segments 3 3"]]:
    """Filter the rotations, and place the points anew.

    Each bone is filtered in the frame of its segment, where it is constant if it has the skeleton's length. So forward
    kinematics of the filtered rotations give the filtered points, if those of the rotations gave the points.

    Args:
        points: Joints, then tips (world, m).
        rotations: Rotation of each segment from the body frame at rest to the world.
        skeleton: The skeleton that they are of (m).
        low: The filter over the first axis.
    """
    rest = np.concatenate([skeleton.rest_joints, skeleton.rest_tips]).astype(np.float64)
    pivots, template = np.asarray(skeleton.pivots, np.float64), skeleton.template
    pivot_of = {pivot.joint: number for number, pivot in enumerate(template.pivots)}
    turned = _filtered_rotations(rotations, _bones(template, rest, pivots), low)
    new = np.empty_like(points)
    new[:, 0] = low(points[:, 0])
    carriers = template.segment_of_joint + template.segment_of_tip
    for point, (parent, segment) in enumerate(zip(template.point_parents.tolist(), carriers, strict=True)):
        if parent < 0:
            continue
        start, new_start = points[:, parent], new[:, parent]
        if point in pivot_of:
            pivot = pivot_of[point]
            near = pivots[pivot] - rest[parent]
            start, new_start = start + rotations[:, segment] @ near, new_start + turned[:, segment] @ near
            segment = template.segment_of_pivot[pivot]
        bone = np.einsum("fji,fj->fi", rotations[:, segment], points[:, point] - start)
        new[:, point] = new_start + np.einsum("fij,fj->fi", turned[:, segment], low(bone))
    return new, turned


def _bones(
    template: SkeletonTemplate, rest: Float[np.ndarray, "points 3"], pivots: Float[np.ndarray, "pivots 3"]
) -> Float[np.ndarray, "segments 3"]:
    """Direction at rest of a line of each segment, whose filtered direction its rotation keeps: its first bone.

    Of a first segment that holds two limbs, such as the pelvis, it is the line from the right to the left one.
    """
    # A segment without a bone may keep any line.
    bones = np.tile([1.0, 0.0, 0.0], (len(template.segment_names), 1))
    parents, carriers = template.point_parents, template.segment_of_joint + template.segment_of_tip
    for point in range(len(rest) - 1, 0, -1):
        bones[carriers[point]] = rest[point] - rest[parents[point]]
    for number, (pivot, segment) in enumerate(zip(template.pivots, template.segment_of_pivot, strict=True)):
        bones[carriers[pivot.joint]] = pivots[number] - rest[parents[pivot.joint]]
        bones[segment] = rest[pivot.joint] - pivots[number]
    for left, right in template.limb_pairs.tolist():
        if carriers[left] == carriers[right] == 0:
            bones[0] = rest[left] - rest[right]
    return unit(bones)


def _filtered_rotations(
    rotations: Float[np.ndarray, "frames segments 3 3"],
    bones: Float[np.ndarray, "segments 3"],
    low: Callable[[np.ndarray], np.ndarray],
) -> Float[np.ndarray, "frames segments 3 3"]:
    """The rotations nearest to the filtered matrices, turned by the least angles to the filtered bones."""
    mean = low(rotations)
    turned = nearest_rotation(mean)
    ways, goals = (np.einsum("fsij,sj->fsi", each, bones) for each in (turned, mean))
    return aligning(ways, unit(goals)) @ turned
