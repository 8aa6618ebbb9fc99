"""Quaternions of poses: the rotations they stand for, their order, and their signs over time."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.poses import moving, placed, posed

from jaxskel import Pose, default_adult

HALF = np.sqrt(0.5)


def test_w_comes_first():
    # A quarter turn about z.
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    poses = placed(default_adult(), Pose(np.zeros((1, 3)), np.tile(quarter, (1, 17, 1, 1))), 30.0)
    np.testing.assert_allclose(poses.quaternions[0], np.tile([HALF, 0, 0, HALF], (17, 1)), atol=1e-6)
    local = np.tile([1.0, 0, 0, 0], (17, 1))
    local[0] = HALF, 0, 0, HALF
    np.testing.assert_allclose(poses.local_quaternions[0], local, atol=1e-6)


def test_they_are_the_rotations_and_do_not_flip():
    # Three times round, with gaps: half of the way, the other sign is the one with positive w.
    frames, gaps = 90, (0, 33, 34, 89)
    angles = np.linspace(0, 6 * np.pi, frames)
    turn = Rotation.from_rotvec(np.outer(angles, [0.6, 0.0, 0.8])).as_matrix()
    poses = moving(frames)
    turned = turn[:, None] @ poses.pose.rotations
    poses = posed(poses.joints, poses.tips, 30.0, "+Z", gaps, 0, turned, default_adult())
    for quaternions, rotations in (
        (poses.quaternions, poses.pose.rotations), (poses.local_quaternions, poses.local_rotations),
    ):  # fmt: skip
        assert quaternions.shape == (frames, 17, 4)
        np.testing.assert_array_equal(np.isnan(quaternions).all((1, 2)), ~poses.has_pose)
        seen = quaternions[poses.has_pose]
        back = Rotation.from_quat(np.roll(seen, -1, -1).reshape(-1, 4)).as_matrix().reshape(-1, 17, 3, 3)
        np.testing.assert_allclose(back, rotations[poses.has_pose], atol=1e-6)
        assert ((seen[1:] * seen[:-1]).sum(-1) > 0.5).all()
    assert poses.quaternions[1, 0, 0] >= 0
    assert (poses.quaternions[poses.has_pose][:, 0, 0] < -0.5).any()


def test_without_a_pose_or_rotations():
    assert np.isnan(moving(2, without=(0, 1)).quaternions).all()
    exact = moving(2)
    with pytest.raises(ValueError, match="hold no rotations"):
        _ = posed(exact.joints, exact.tips, 30.0, "+Z").quaternions
