"""Realistic bodies and a real recording, from the shared data beside the developers' checkout."""

import numpy as np
import pytest
from support.shared_data import SEQUENCE, SHARED, eight_views, needs

from jaxskel import Recording, Settings, join_poses, prepare, read_recording, reconstruct_batches
from jaxskel.poses import score

pytestmark = pytest.mark.slow

REAL = SHARED / "real" / "vlasic_crane" / "vlasic_crane.npz"


def run(recording: Recording):
    prepared = prepare(recording, Settings())
    return prepared, join_poses(reconstruct_batches(recording, Settings(), prepared))


@needs(SEQUENCE)
def test_a_realistic_body_with_free_arms():
    recording = eight_views(read_recording(SEQUENCE)[::8])
    assert recording.truth is not None
    _, poses = run(recording)
    result = score(poses.joints.astype(float), recording.truth.joints, poses.has_pose)
    assert poses.has_pose.all()
    assert result.wrong("l_foot") + result.wrong("r_foot") == 0
    assert result.wrong("l_hand") + result.wrong("r_hand") == 0
    assert result.percentile(50) < 0.012
    # The big toes of this skeleton point inwards at rest; flesh that was turned by them once more cost 16 mm.
    assert max(result.percentile(50, joint) for joint in ("l_foot", "r_foot")) < 0.010


@needs(REAL)
def test_a_real_person_of_unknown_dimensions_stands_upright_on_the_floor():
    # World +Y up, floor at y = 0; arms lifted in wide sleeves, one knee up.
    prepared, poses = run(read_recording(REAL)[:96:48])
    assert not prepared.skeleton_is_known
    assert poses.has_pose.all()
    joints = poses.joints
    trunk = joints[:, 1] - joints[:, 0]
    tilt = np.degrees(np.arccos(trunk[:, 1] / np.linalg.norm(trunk, axis=1)))
    assert tilt.max() < 20
    assert ((joints[:, 2, 1] > 1.5) & (joints[:, 2, 1] < 1.9)).all()
    lower_foot = joints[:, [11, 14], 1].min(1)
    assert ((lower_foot > -0.02) & (lower_foot < 0.13)).all()
