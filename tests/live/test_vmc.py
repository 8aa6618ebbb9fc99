"""Poses as bones in Unity's frame: identities, handedness, and forward kinematics lead back to the joints."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.live_sessions import step_of
from support.poses import moving, placed
from support.templates import acting, animal

from jaxskel import JOINT_NAMES, Pose, Poses, default_adult
from jaxskel.io.poses import t_pose_of, with_up
from jaxskel.live import BONE_NAMES, BONE_PARENTS, Bones, bones_of

ADULT = default_adult(1.8)
# Where the bones of an avatar begin, as joints of ours; hands begin at the wrists, which are none.
JOINT_OF_BONE = {
    "Hips": "pelvis", "Spine": "pelvis", "Neck": "neck", "Head": "head",
    **{
        f"{side}{bone}": f"{letter}_{joint}"
        for side, letter in (("Left", "l"), ("Right", "r"))
        for bone, joint in (
            ("UpperArm", "shoulder"), ("LowerArm", "elbow"), ("UpperLeg", "hip"), ("LowerLeg", "knee"),
            ("Toes", "foot"),
        )
    },
}  # fmt: skip


def in_unity(points: np.ndarray) -> np.ndarray:
    """Points of a world with z up, for somebody who looks along x: right, up, ahead."""
    return np.stack([-points[..., 1], points[..., 2], points[..., 0]], -1)


def unity_points(bones: Bones) -> np.ndarray:
    """Where the bones begin, by an avatar's own forward kinematics."""
    points, turns = np.zeros((len(BONE_NAMES), 3)), [Rotation.identity()] * len(BONE_NAMES)
    for bone, parent in enumerate(BONE_PARENTS):
        turn = Rotation.from_quat(bones.quaternions[bone])
        if parent < 0:
            points[bone], turns[bone] = bones.positions[bone], turn
        else:
            points[bone] = points[parent] + turns[parent].apply(bones.positions[bone])
            turns[bone] = turns[parent] * turn
    return points


def t_pose(angle: float = 0.0) -> Pose:
    """The arms to the sides, facing x, then turned about z (rad)."""
    turn = Rotation.from_rotvec([0, 0, angle]).as_matrix()
    return Pose(np.array([[0.5, 2.0, 1.0]]), (turn @ t_pose_of(ADULT).upright)[None])


def test_a_t_pose_that_faces_ahead_has_no_rotation():
    bones = bones_of(placed(ADULT, t_pose(), 25.0))
    np.testing.assert_allclose(np.abs(bones.quaternions), np.tile([0, 0, 0, 1], (20, 1)), atol=1e-6)
    points = dict(zip(BONE_NAMES, unity_points(bones), strict=True))
    assert points["Hips"] == pytest.approx([-2.0, 1.0, 0.5])
    assert points["RightLowerArm"][0] > points["RightUpperArm"][0] + 0.2  # right is +X
    assert points["LeftToes"][2] > points["LeftFoot"][2]  # ahead is +Z
    assert points["Head"][1] > points["Neck"][1] > points["Hips"][1]  # up is +Y


def test_turning_to_the_left_is_turning_to_minus_x():
    bones = bones_of(placed(ADULT, t_pose(np.pi / 2), 25.0))
    ahead = Rotation.from_quat(bones.quaternions[0]).apply([0, 0, 1])
    assert ahead == pytest.approx([-1, 0, 0], abs=1e-6)
    np.testing.assert_allclose(np.abs(bones.quaternions[1:]), np.tile([0, 0, 0, 1], (19, 1)), atol=1e-6)


@pytest.mark.parametrize("up", ["+Z", "+Y", "-X"])
def test_forward_kinematics_give_the_joints_again(up):
    poses = moving(6, up=up)
    wrists = _wrists(with_up(poses, "+Z"))
    for frame in range(len(poses)):
        step = step_of(poses, frame)
        bones = bones_of(step)
        found = dict(zip(BONE_NAMES, unity_points(bones), strict=True))
        joints = in_unity(with_up(step, "+Z").joints[0].astype(float))
        for bone, joint in JOINT_OF_BONE.items():
            assert found[bone] == pytest.approx(joints[JOINT_NAMES.index(joint)], abs=1e-5), bone
        for bone, wrist in zip(("LeftHand", "RightHand"), wrists[frame], strict=True):
            assert found[bone] == pytest.approx(in_unity(wrist), abs=1e-5)
        np.testing.assert_allclose(np.linalg.norm(bones.quaternions, axis=-1), 1, atol=1e-9)


def _wrists(poses: Poses) -> np.ndarray:
    """Wrists, which move with the forearms, as points of those (z up, m)."""
    rest = np.asarray(ADULT.rest_joints, float)
    found = []
    for elbow, segment, pivot in ((4, 5, 0), (7, 8, 1)):
        offset = np.asarray(ADULT.pivots[pivot], float) - rest[elbow]
        found.append(poses.joints[:, elbow] + poses.rotations[:, segment] @ offset)
    return np.stack(found, 1)


def test_without_a_pose_or_rotations_there_are_no_bones():
    assert bones_of(step_of(moving(3, without=(1,)), 1)) is None
    assert bones_of(replace(step_of(moving(3), 1), rotations=None, skeleton=None)) is None


def test_other_templates_have_no_avatar():
    with pytest.raises(ValueError, match="animal has no bones of an avatar, .*; leave out --osc"):
        bones_of(acting(animal(), 2))
