"""Smoothing over time: which frequencies pass, and which frames stay unchanged."""

from dataclasses import replace

import equinox as eqx
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.phantoms import pose_of

from jaxskel import JOINT_PARENTS, Pose, Poses, Skeleton, Status, default_adult, make_skeleton, smooth
from jaxskel.body import JOINT_OF_PIVOT, place_joints

FPS, FRAMES = 60.0, 120


def moving(frequency: float, amplitude: float = 0.1) -> Poses:
    """A rigid pose that swings along x."""
    pose = pose_of(3)
    time = np.arange(FRAMES) / FPS
    root = np.asarray(pose.root)[None] + amplitude * np.sin(2 * np.pi * frequency * time)[:, None] * [1.0, 0.0, 0.0]
    rotations = np.repeat(np.asarray(pose.rotations)[None], FRAMES, 0)
    joints, tips = (np.asarray(a) for a in place_joints(default_adult(), Pose(root, rotations)))
    return Poses(
        joints, tips, rotations.astype(np.float32), default_adult(), np.ones((FRAMES, 15), np.float32),
        np.ones(FRAMES, np.float32), np.zeros(FRAMES, int), FPS, "+Z", np.arange(FRAMES),
    )  # fmt: skip


def swing(poses: Poses) -> float:
    """Amplitude along x (m), away from the ends."""
    x = poses.joints[30:-30, 0, 0]
    return float(x.max() - x.min()) / 2


@pytest.mark.parametrize(("frequency", "left"), [(0.5, 1.0), (6.0, 0.5), (24.0, 0.0)])
def test_amplitude_is_halved_at_the_cutoff(frequency, left):
    before = moving(frequency)
    assert swing(smooth(before, 6.0)) / swing(before) == pytest.approx(left, abs=0.02)


def test_there_is_no_delay():
    before = moving(1.0)
    after = smooth(before, 10.0)
    assert abs(int(after.joints[10:50, 0, 0].argmax()) - int(before.joints[10:50, 0, 0].argmax())) <= 1


def lengths(poses: Poses) -> np.ndarray:
    return np.linalg.norm(poses.joints[:, 1:] - poses.joints[:, list(JOINT_PARENTS[1:])], axis=-1)


def noisy(skeleton: Skeleton) -> Poses:
    """A pose that changes at random from frame to frame, with bent wrists and ankles."""
    rng = np.random.default_rng(0)
    noise = Rotation.from_rotvec(rng.normal(0, 0.2, (FRAMES * 17, 3))).as_matrix().reshape(FRAMES, 17, 3, 3)
    rotations = np.asarray(pose_of(3).rotations) @ noise
    joints, tips = (np.asarray(a) for a in place_joints(skeleton, Pose(rng.normal(0, 0.05, (FRAMES, 3)), rotations)))
    return eqx.tree_at(
        lambda p: (p.joints, p.tips, p.rotations, p.skeleton), moving(1.0),
        (joints, tips, rotations.astype(np.float32), skeleton),
    )  # fmt: skip


def stooping() -> Skeleton:
    """Hips below the pelvis, a head before the neck, and hands that bend at rest: no two bones of a segment in line."""
    adult = default_adult()
    joints, tips = np.array(adult.rest_joints), np.array(adult.rest_tips)
    joints[9:, 2] -= 0.05
    tips[0, 0] += 0.1
    tips[1:3, 0] += 0.05
    return make_skeleton(joints, tips)


def kinematics(poses: Poses) -> tuple[np.ndarray, np.ndarray]:
    joints, tips = place_joints(poses.skeleton, poses.pose)
    return np.asarray(joints), np.asarray(tips)


def test_joints_are_where_the_smoothed_rotations_place_them():
    before = noisy(stooping())
    after = smooth(before, 6.0)
    joints, tips = kinematics(after)
    np.testing.assert_allclose(after.joints, joints, atol=2e-6)
    np.testing.assert_allclose(after.tips, tips, atol=2e-6)
    identity = np.broadcast_to(np.eye(3), after.rotations.shape)
    np.testing.assert_allclose(after.rotations @ after.rotations.swapaxes(-1, -2), identity, atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(after.rotations), 1.0, atol=1e-6)
    turns = (Rotation.from_matrix(poses.local_rotations[:, 4]) for poses in (before, after))
    rough, smoother = (float((one[1:] * one[:-1].inv()).magnitude().mean()) for one in turns)
    assert smoother < 0.3 * rough


def test_bones_are_smoothed_as_without_rotations():
    before = noisy(default_adult())
    after, without = (smooth(poses, 6.0) for poses in (before, older(before)))
    for joint in (1, 2, 3, 4, 10):
        parent = JOINT_PARENTS[joint]
        np.testing.assert_allclose(*(p.joints[:, joint] - p.joints[:, parent] for p in (after, without)), atol=1e-5)


def older(poses: Poses) -> Poses:
    """As an older version wrote them."""
    return replace(poses, rotations=None, skeleton=None)


def test_bones_that_vary_in_length_do_so_smoothly():
    before = noisy(default_adult())
    joints = before.joints.copy()
    thigh = joints[:, 10] - joints[:, 9]
    time = np.arange(FRAMES) / FPS
    joints[:, [10, 11]] += (0.1 * np.sin(2 * np.pi * time)[:, None] * thigh)[:, None]
    after = smooth(eqx.tree_at(lambda p: p.joints, before, joints), 10.0)
    found = lengths(after)[20:-20, 9] / default_adult().bone_lengths[9]
    np.testing.assert_allclose(found, 1 + 0.1 * np.sin(2 * np.pi * time)[20:-20], atol=1e-3)


@pytest.mark.parametrize("of", [lambda poses: poses, older])
def test_bones_keep_their_lengths_under_noise(of):
    before = of(noisy(default_adult()))
    after = smooth(before, 6.0)
    assert np.abs(after.joints - before.joints).max() > 0.02
    rigid = np.delete(np.arange(14), np.array(JOINT_OF_PIVOT) - 1)  # without a wrist or an ankle within
    expected = np.tile(default_adult().bone_lengths[rigid], (FRAMES, 1))
    np.testing.assert_allclose(lengths(before)[:, rigid], expected, atol=1e-5)
    np.testing.assert_allclose(lengths(after)[:, rigid], expected, atol=1e-5)


def test_gaps_are_neither_filled_nor_crossed():
    before = moving(2.0)
    status = before.status.copy()
    status[60] = Status.EMPTY
    joints = before.joints.copy()
    joints[60] = np.nan
    joints[61:, :, 1] += 5.0
    before = eqx.tree_at(lambda p: (p.joints, p.status), before, (joints, status))
    after = smooth(before, 6.0)
    assert np.isnan(after.joints[60]).all()
    assert np.isfinite(np.delete(after.joints, 60, 0)).all()
    assert np.abs(after.joints[:60, :, 1] - before.joints[:60, :, 1]).max() < 0.01


def test_short_runs_are_left_alone():
    before = moving(20.0)
    status = np.full(FRAMES, int(Status.EMPTY))
    status[:10] = Status.OK
    before = eqx.tree_at(lambda p: p.status, before, status)
    np.testing.assert_array_equal(smooth(before, 6.0).joints, before.joints)


@pytest.mark.parametrize("cutoff", [0.0, -1.0, 30.0, float("nan")])
def test_a_cutoff_that_means_nothing_is_refused(cutoff):
    with pytest.raises(ValueError, match="between 0 and 30 Hz"):
        smooth(moving(1.0), cutoff)
