"""Poses and tracks of random numbers."""

import numpy as np
from scipy.spatial.transform import Rotation

from jaxskel import Pose, Poses, default_adult
from jaxskel.search import Rival, Track, no_alternatives


def some_poses(first: int, count: int) -> Poses:
    random = np.random.default_rng(first)
    spread = random.random((count, 15, 3, 3)).astype(np.float32)
    return Poses(
        joints=random.normal(size=(count, 15, 3)).astype(np.float32),
        tips=np.full((count, 5, 3), np.nan, np.float32),
        rotations=Rotation.random(17 * count, first).as_matrix().reshape(count, 17, 3, 3).astype(np.float32),
        skeleton=default_adult(1.6),
        confidence=random.random((count, 15)).astype(np.float32),
        side_confidence=random.random(count).astype(np.float32),
        status=random.integers(0, 9, count), fps=30.0, up="+Y", frame_index=np.arange(first, first + count),
        covariance=spread @ spread.swapaxes(-1, -2) + np.eye(3, dtype=np.float32),
    )  # fmt: skip


def some_track(number: int, rival: bool = False, alternatives: int = 0) -> Track:
    random = np.random.default_rng(number)
    poses = [Pose(random.normal(size=3).astype(np.float32), random.normal(size=(17, 3, 3))) for _ in range(4)]
    other = Rival(poses[2], poses[3], 3.5) if rival else None
    known = no_alternatives(poses[1], alternatives) if alternatives else None
    return Track(poses[0], poses[1], number, random.normal(size=number), 0.7, rival=other, alternatives=known)
