"""Poses of any template, drawn at random within the limits of its joints."""

import numpy as np

from .._math.vectors import unit
from ..body import HINGE, Pose, Skeleton, hinge_axes


def random_poses(skeleton: Skeleton, frames: int, seed: int = 0) -> Pose:
    """Poses that are independent of one another.

    Hinges bend evenly within their range; other segments turn about any axis, up to the template's swings. The whole
    faces anywhere, upright. The skeleton stands at rest with its lowest point at the origin's height.

    Args:
        skeleton: Of a template with swings.
        frames: Number of poses.
        seed: Of the random numbers.

    Raises:
        ValueError: The template says nothing about swings.
    """
    from scipy.spatial.transform import Rotation  # takes a third of a second to import, and is needed here only

    template, rng = skeleton.template, np.random.default_rng(seed)
    if not template.swings:
        raise ValueError(f"skeleton: {template.name!r} says nothing about swings; give a motion")
    count = len(template.segment_names)
    rotations = np.empty((frames, count, 3, 3))
    rotations[:, 0] = Rotation.from_rotvec(rng.uniform(-np.pi, np.pi, (frames, 1)) * [0.0, 0.0, 1.0]).as_matrix()
    axes = np.asarray(hinge_axes(skeleton))
    hinges = {hinge.segment: number for number, hinge in enumerate(template.hinges)}
    rest = np.concatenate([skeleton.rest_joints, skeleton.rest_tips])
    for segment in range(1, count):
        if template.freedoms[segment] == HINGE:
            hinge = template.hinges[hinges[segment]]
            axis = axes[hinges[segment]]
            upper, lower = (
                rest[hinge.joint] - rest[template.point_parents[hinge.joint]],
                rest[hinge.end] - rest[hinge.joint],
            )
            bent = np.arctan2(np.cross(upper, lower) @ axis, upper @ lower)
            turn = (rng.uniform(hinge.straight, hinge.folded, (frames, 1)) - bent) * axis
        else:
            turn = unit(rng.normal(size=(frames, 3)))
            turn *= template.swings[segment] * rng.uniform(size=(frames, 1))
        rotations[:, segment] = rotations[:, template.segment_parents[segment]] @ Rotation.from_rotvec(turn).as_matrix()
    return Pose(np.tile([0.0, 0.0, -rest[:, 2].min()], (frames, 1)), rotations)
