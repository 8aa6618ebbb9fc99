"""Poses to export: the package's own motion, with gaps, in any world."""

import numpy as np

from jaxskel import JOINT_NAMES, TIP_NAMES, Pose, Poses, Skeleton, Status, default_adult
from jaxskel.body import HUMAN_15, place_joints
from jaxskel.io.poses._markers import turn_up
from jaxskel.synthetic import demo_motion

POINT_NAMES = JOINT_NAMES + TIP_NAMES


def moving(
    frames: int = 40, fps: float = 29.97, up: str = "+Z", without: tuple[int, ...] = (), start: int = 0
) -> Poses:
    """An average adult who moves, somewhere in a world whose up axis is `up`, and has no pose in some frames."""
    skeleton = default_adult(1.8)
    motion = demo_motion(skeleton, frames, fps)
    standing = Pose(np.asarray(motion.root) + [0.3, -1.2, 0.1], np.asarray(motion.rotations))
    return placed(skeleton, standing, fps, up, without, start)


def placed(
    skeleton: Skeleton, pose: Pose, fps: float, up: str = "+Z", without: tuple[int, ...] = (), start: int = 0
) -> Poses:
    """Where forward kinematics place a skeleton, in a world that is turned from one with z up."""
    turn = turn_up("+Z", up)
    joints, tips = (np.asarray(x, np.float64) @ turn.T for x in place_joints(skeleton, pose))
    return posed(joints, tips, fps, up, without, start, turn @ pose.rotations, skeleton)


def posed(
    joints: np.ndarray, tips: np.ndarray, fps: float, up: str, without: tuple[int, ...] = (), start: int = 0,
    rotations: np.ndarray | None = None, skeleton: Skeleton | None = None,
) -> Poses:  # fmt: skip
    """Poses with these joints and tips."""
    frames, gaps = len(joints), list(without)
    if rotations is not None:
        rotations = rotations.astype(np.float32)
        rotations[gaps] = np.nan
    joints, tips = joints.astype(np.float32), tips.astype(np.float32)
    status = np.full(frames, int(Status.OK))
    joints[gaps], tips[gaps], status[gaps] = np.nan, np.nan, int(Status.NO_HULL)
    covariance = np.tile(np.diag([0.01, 0.02, 0.03]).astype(np.float32) ** 2, (frames, joints.shape[1], 1, 1))
    covariance[gaps] = np.nan
    confidence = np.where(status == Status.OK, 1.0, 0.0).astype(np.float32)
    return Poses(
        joints, tips, rotations, skeleton, np.repeat(confidence[:, None], joints.shape[1], 1),
        np.ones(frames, np.float32), status, fps, up, np.arange(start, start + frames), covariance,
        template=HUMAN_15 if skeleton is None else skeleton.template,
    )  # fmt: skip


def points(poses: Poses, up: str) -> np.ndarray:
    """Joints and tips (m) in a world where `up` points up, by columns, as Pose2Sim exchanges them."""
    both = np.concatenate([poses.joints, poses.tips], 1).astype(np.float64)
    assert {poses.up, up} <= {"+Z", "+Y"}
    if poses.up == up:
        return both
    return both[..., [1, 2, 0]] if up == "+Y" else both[..., [2, 0, 1]]
