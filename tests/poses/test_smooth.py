"""Smoothing over time: which frequencies pass, and which frames stay unchanged."""

import equinox as eqx
import numpy as np
import pytest
from support.phantoms import pose_of

from jaxskel import JOINT_PARENTS, Pose, Poses, Status, default_adult, smooth
from jaxskel.body import place_joints

FPS, FRAMES = 60.0, 120


def moving(frequency: float, amplitude: float = 0.1) -> Poses:
    """A rigid pose that swings along x."""
    pose = pose_of(3)
    time = np.arange(FRAMES) / FPS
    root = np.asarray(pose.root)[None] + amplitude * np.sin(2 * np.pi * frequency * time)[:, None] * [1.0, 0.0, 0.0]
    rotations = np.repeat(np.asarray(pose.rotations)[None], FRAMES, 0)
    joints, tips = (np.asarray(a) for a in place_joints(default_adult(), Pose(root, rotations)))
    return Poses(
        joints, tips, np.ones((FRAMES, 15), np.float32), np.ones(FRAMES, np.float32), np.zeros(FRAMES, int), FPS, "+Z",
        np.arange(FRAMES),
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


def test_bones_keep_their_lengths_under_noise():
    rng = np.random.default_rng(0)
    poses = [pose_of(i, 0.3) for i in rng.integers(0, 50, FRAMES)]
    stacked = Pose(np.stack([p.root for p in poses]), np.stack([p.rotations for p in poses]))
    joints, tips = (np.asarray(a) for a in place_joints(default_adult(), stacked))
    before = eqx.tree_at(lambda p: (p.joints, p.tips), moving(1.0), (joints, tips))
    after = smooth(before, 6.0)
    assert np.abs(after.joints - before.joints).max() > 0.02
    assert np.ptp(lengths(before)[:, 8:], axis=0).max() < 1e-5
    np.testing.assert_allclose(lengths(after)[:, 8:], lengths(before)[:, 8:], atol=1e-5)


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
