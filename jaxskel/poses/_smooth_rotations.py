"""Low-pass filtering of poses whose rotations are known: the points go with their segments."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from .._math.rotations import aligning, nearest_rotation
from .._math.vectors import unit
from ..body import (
    JOINT_NAMES,
    JOINT_OF_PIVOT,
    JOINT_PARENTS,
    SEGMENT_NAMES,
    SEGMENT_OF_JOINT,
    SEGMENT_OF_PIVOT,
    SEGMENT_OF_TIP,
    TIP_PARENTS,
    Skeleton,
)

_PARENTS = JOINT_PARENTS + TIP_PARENTS
_SEGMENTS = SEGMENT_OF_JOINT + SEGMENT_OF_TIP


def filtered_poses(
    points: Float[np.ndarray, "frames points=20 3"],
    rotations: Float[np.ndarray, "frames segments=17 3 3"],
    skeleton: Skeleton,
    low: Callable[[np.ndarray], np.ndarray],
) -> tuple[Float[np.ndarray, "frames points=20 3"], Float[np.ndarray, "frames segments=17 3 3"]]:
    """Filter the rotations, and place the points anew.

    Each bone is filtered in the frame of its segment, where it is constant if it has the template's length. So forward
    kinematics of the filtered rotations give the filtered points, if those of the rotations gave the points.

    Args:
        points: Joints, then tips (world, m).
        rotations: Rotation of each segment from the body frame at rest to the world.
        skeleton: The template (m).
        low: The filter over the first axis.
    """
    rest = np.concatenate([skeleton.rest_joints, skeleton.rest_tips]).astype(np.float64)
    pivots = np.asarray(skeleton.pivots, np.float64)
    turned = _filtered_rotations(rotations, _bones(rest, pivots), low)
    new = np.empty_like(points)
    new[:, 0] = low(points[:, 0])
    for point, (parent, segment) in enumerate(zip(_PARENTS, _SEGMENTS, strict=True)):
        if parent < 0:
            continue
        start, new_start = points[:, parent], new[:, parent]
        if point in JOINT_OF_PIVOT:
            pivot = JOINT_OF_PIVOT.index(point)
            near = pivots[pivot] - rest[parent]
            start, new_start = start + rotations[:, segment] @ near, new_start + turned[:, segment] @ near
            segment = SEGMENT_OF_PIVOT[pivot]
        bone = np.einsum("fji,fj->fi", rotations[:, segment], points[:, point] - start)
        new[:, point] = new_start + np.einsum("fij,fj->fi", turned[:, segment], low(bone))
    return new, turned


def _bones(
    rest: Float[np.ndarray, "points=20 3"], pivots: Float[np.ndarray, "pivots=4 3"]
) -> Float[np.ndarray, "segments=17 3"]:
    """Direction at rest of a line of each segment, whose filtered direction its rotation keeps: its first bone.

    Of the pelvis it is the line from right to left hip.
    """
    bones = np.empty((len(SEGMENT_NAMES), 3))
    for point in range(len(rest) - 1, 0, -1):
        bones[_SEGMENTS[point]] = rest[point] - rest[_PARENTS[point]]
    for pivot, (joint, segment) in enumerate(zip(JOINT_OF_PIVOT, SEGMENT_OF_PIVOT, strict=True)):
        bones[_SEGMENTS[joint]] = pivots[pivot] - rest[_PARENTS[joint]]
        bones[segment] = rest[joint] - pivots[pivot]
    bones[SEGMENT_NAMES.index("pelvis")] = rest[JOINT_NAMES.index("l_hip")] - rest[JOINT_NAMES.index("r_hip")]
    return unit(bones)


def _filtered_rotations(
    rotations: Float[np.ndarray, "frames segments=17 3 3"],
    bones: Float[np.ndarray, "segments=17 3"],
    low: Callable[[np.ndarray], np.ndarray],
) -> Float[np.ndarray, "frames segments=17 3 3"]:
    """The rotations nearest to the filtered matrices, turned by the least angles to the filtered bones."""
    mean = low(rotations)
    turned = nearest_rotation(mean)
    ways, goals = (np.einsum("fsij,sj->fsi", each, bones) for each in (turned, mean))
    return aligning(ways, unit(goals)) @ turned
