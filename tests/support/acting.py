"""A body whose every joint moves as a person's can: for what plays poses back, or finds their angles."""

import numpy as np
from scipy.spatial.transform import Rotation

from jaxskel import Pose, Poses, default_adult
from jaxskel.body import SEGMENT_NAMES, SEGMENT_PARENTS, neutral_posture
from support.poses import placed

# Axes of rotation, one after the other, and ranges (degrees) about each: x to the front, y to the left, z up.
_RANGES = {
    "pelvis": (("z", -60, 60), ("x", -15, 15), ("y", -20, 30)),
    "chest": (("y", -20, 40), ("x", -20, 20), ("z", -30, 30)),
    "head": (("y", -30, 30), ("x", -25, 25)),
    "clavicle": (("x", -10, 10), ("z", -10, 10)),
    "upper_arm": (("y", -80, 40), ("x", -50, 60), ("z", -40, 40)),
    "forearm": (("y", -110, -20),),
    "hand": (("x", -40, 40), ("y", -20, 20)),
    "thigh": (("y", -80, 20), ("x", -25, 25), ("z", -20, 20)),
    "shank": (("y", 5, 100),),
    "foot": (("y", -20, 30), ("x", -15, 15), ("z", -15, 15)),
}


def acting(frames: int, fps: float, up: str = "+Z", without: tuple[int, ...] = ()) -> Poses:
    """An average adult who moves each joint to and fro, as fast as no other one."""
    skeleton, times = default_adult(1.8), np.arange(frames) / 30
    turned = np.empty((frames, len(SEGMENT_NAMES), 3, 3))
    for i, (name, parent) in enumerate(zip(SEGMENT_NAMES, SEGMENT_PARENTS, strict=True)):
        local = np.tile(np.eye(3), (frames, 1, 1))
        for j, (axis, low, high) in enumerate(_RANGES[name.removeprefix("l_").removeprefix("r_")]):
            swing = np.sin(2 * np.pi * (0.2 + 0.013 * i + 0.05 * j) * times + i + 2 * j)
            angles = np.deg2rad(low + (high - low) * (1 + swing) / 2)
            local = local @ Rotation.from_rotvec(np.outer(angles, np.eye(3)["xyz".index(axis)])).as_matrix()
        turned[:, i] = local if parent < 0 else turned[:, parent] @ local
    root = np.stack([times, np.sin(times), 1 + 0.1 * np.cos(times)], 1)
    return placed(skeleton, Pose(root, turned @ neutral_posture(skeleton)), fps, up, without)
