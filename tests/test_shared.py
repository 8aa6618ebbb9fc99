"""Realistic bodies and a real recording, which lie beside the checkout where the project is developed."""

from pathlib import Path

import numpy as np
import pytest

from jaxskel import Settings, join_poses, prepare, read_recording, reconstruct_batches
from jaxskel.metrics import score

SHARED = Path(__file__).parents[2] / "shared" / "data"
SEQUENCE = SHARED / "sequences" / "16_11_male.npz"
REAL = SHARED / "real" / "vlasic_crane" / "vlasic_crane.npz"


def needs(path: Path):
    return pytest.mark.skipif(not path.exists(), reason=f"needs {'/'.join(path.parts[-3:])} in ../shared/data")


def run(path: Path, frames: slice):
    recording = read_recording(path)
    prepared = prepare(recording, Settings())
    return recording[frames], join_poses(reconstruct_batches(recording[frames], prepared=prepared))


@needs(SEQUENCE)
def test_a_realistic_body_with_free_arms():
    recording, poses = run(SEQUENCE, slice(None))
    assert recording.truth is not None
    result = score(poses.joints.astype(float), recording.truth.joints, poses.has_pose)
    assert poses.has_pose.all()
    assert result.wrong("l_foot") + result.wrong("r_foot") == 0
    assert result.wrong("l_hand") + result.wrong("r_hand") <= 6  # of 120
    assert result.percentile(50) < 0.045


@needs(REAL)
def test_a_real_person_of_unknown_dimensions_stands_upright_on_the_floor():
    _, poses = run(REAL, slice(0, 96, 3))  # world +Y up, floor at y = 0; arms lifted in wide sleeves, one knee up
    assert poses.has_pose.mean() >= 0.95
    joints = poses.joints[poses.has_pose]
    trunk = joints[:, 1] - joints[:, 0]
    tilt = np.degrees(np.arccos(trunk[:, 1] / np.linalg.norm(trunk, axis=1)))
    assert tilt.max() < 20
    assert ((joints[:, 2, 1] > 1.5) & (joints[:, 2, 1] < 1.9)).all()
    lower_foot = joints[:, [11, 14], 1].min(1)
    assert ((lower_foot > -0.02) & (lower_foot < 0.13)).all()
