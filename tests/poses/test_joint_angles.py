"""Joint angles: zero, size, sign and axis of each; mirrors, worlds, and films."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.poses import moving, placed, posed

from jaxskel import JOINT_NAMES, TIP_NAMES, Pose, Poses, default_adult
from jaxskel.body import SEGMENT_NAMES, SEGMENT_PARENTS, neutral_posture
from jaxskel.poses import ANGLE_NAMES, joint_angles
from jaxskel.recording import UP_AXES

ADULT = default_adult(1.8)
FRONT, LEFT, UP = np.eye(3)

# Segment that turns, axis of a positive angle, a point that it moves, and where to. x to the front, y left, z up.
CASES = {
    "pelvis_tilt": ("pelvis", -LEFT, "neck", -FRONT),
    "pelvis_list": ("pelvis", FRONT, "neck", -LEFT),
    "pelvis_rotation": ("pelvis", UP, "r_hip", FRONT),
    "lumbar_extension": ("chest", -LEFT, "neck", -FRONT),
    "lumbar_bending": ("chest", FRONT, "neck", -LEFT),
    "lumbar_rotation": ("chest", UP, "r_shoulder", FRONT),
    "neck_extension": ("head", -LEFT, "head_top", -FRONT),
    "neck_bending": ("head", FRONT, "head_top", -LEFT),
    "neck_rotation": ("head", UP, "head", LEFT),
    "hip_flexion_r": ("r_thigh", -LEFT, "r_knee", FRONT),
    "hip_adduction_r": ("r_thigh", FRONT, "r_knee", LEFT),
    "hip_rotation_r": ("r_thigh", UP, "r_toetip", LEFT),
    "knee_angle_r": ("r_shank", LEFT, "r_foot", -FRONT),
    "knee_adduction_r": ("r_shank", FRONT, "r_foot", LEFT),
    "knee_rotation_r": ("r_shank", UP, "r_toetip", LEFT),
    "ankle_angle_r": ("r_foot", -LEFT, "r_toetip", UP),
    "ankle_inversion_r": ("r_foot", FRONT, "r_toetip", LEFT),
    "ankle_rotation_r": ("r_foot", UP, "r_toetip", LEFT),
    "arm_flex_r": ("r_upper_arm", -LEFT, "r_elbow", FRONT),
    "arm_add_r": ("r_upper_arm", FRONT, "r_elbow", LEFT),
    "arm_rot_r": ("r_upper_arm", UP, None, None),  # of a straight arm, which stays where it is
    "elbow_flex_r": ("r_forearm", -LEFT, "r_hand", FRONT),
    "elbow_add_r": ("r_forearm", FRONT, "r_hand", LEFT),
    "pro_sup_r": ("r_forearm", UP, None, None),
    "wrist_flex_r": ("r_hand", FRONT, "r_fingertip", LEFT),
    "wrist_dev_r": ("r_hand", LEFT, "r_fingertip", -FRONT),
    "wrist_rot_r": ("r_hand", UP, None, None),
}


def mirrored_case(name: str) -> tuple:
    """The case of the left side: a mirrored axis of rotation points the other way round."""
    segment, axis, point, way = CASES[name.removesuffix("_l") + "_r"]
    mirror = np.diag([1.0, -1.0, 1.0])
    return (
        segment.replace("r_", "l_", 1), -mirror @ axis, point and point.replace("r_", "l_", 1),
        None if way is None else mirror @ way,
    )  # fmt: skip


def bent(segment: str, turns: np.ndarray) -> Poses:
    """The neutral posture, in which a segment turns, frame by frame, with all that hangs on it."""
    moved = SEGMENT_NAMES.index(segment)
    turning = {moved}
    for child, parent in enumerate(SEGMENT_PARENTS):
        # Hands and feet come after what they hang on.
        turning |= {child} if parent in turning else set()
    rotations = np.tile(neutral_posture(ADULT), (len(turns), 1, 1, 1))
    rotations[:, sorted(turning)] = turns[:, None] @ rotations[:, sorted(turning)]
    return placed(ADULT, Pose(np.zeros((len(turns), 3)), rotations), 30.0)


def about(axis: np.ndarray, angles: np.ndarray) -> np.ndarray:
    return Rotation.from_rotvec(np.outer(angles, axis)).as_matrix()


@pytest.mark.parametrize("name", ANGLE_NAMES)
def test_a_body_bent_by_an_angle_has_that_angle_and_no_other(name):
    segment, axis, point, way = CASES[name] if name in CASES else mirrored_case(name)
    angles = np.deg2rad([-60.0, -10.0, 0.0, 10.0, 60.0])
    poses = bent(segment, about(axis, angles))
    found = joint_angles(poses)
    expected = np.zeros((5, len(ANGLE_NAMES)))
    expected[:, ANGLE_NAMES.index(name)] = angles
    np.testing.assert_allclose(found.values, expected, atol=1e-6)
    if point is not None:
        at = np.concatenate([poses.joints, poses.tips], 1)[:, (JOINT_NAMES + TIP_NAMES).index(point)]
        steps = np.diff(at[1:4] @ way)
        assert (steps > 1e-3).all()


def test_neutral_limbs_hang_and_feet_point_ahead():
    poses = bent("pelvis", np.eye(3)[None])
    at = dict(zip(JOINT_NAMES + TIP_NAMES, np.concatenate([poses.joints, poses.tips], 1)[0], strict=True))
    for side in "lr":
        for start, end in (("shoulder", "elbow"), ("elbow", "hand"), ("hip", "knee")):
            bone = at[f"{side}_{end}"] - at[f"{side}_{start}"]
            np.testing.assert_allclose(bone / np.linalg.norm(bone), -UP, atol=1e-6)
        foot = at[f"{side}_toetip"] - at[f"{side}_foot"]
        assert foot[0] > 0
        assert abs(foot[1]) < 0.1 * foot[0]


def mixed(seed: int, frames: int = 6, largest: float = 1.0) -> Pose:
    """Any posture, each segment turned by up to `largest` (rad) from its neighbour in the neutral one."""
    rng = np.random.default_rng(seed)
    vectors = rng.normal(size=(frames, 17, 3))
    vectors *= (rng.uniform(0, largest, (frames, 17)) / np.linalg.norm(vectors, axis=-1))[..., None]
    local = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(frames, 17, 3, 3)
    turned = local.copy()
    for child, parent in enumerate(SEGMENT_PARENTS[1:], 1):
        turned[:, child] = turned[:, parent] @ local[:, child]
    return Pose(rng.normal(size=(frames, 3)), turned @ neutral_posture(ADULT))


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_mirrored_pose_has_the_angles_of_the_other_side(seed):
    pose, mirror = mixed(seed), np.diag([1.0, -1.0, 1.0])
    others = [
        SEGMENT_NAMES.index({"l": "r_", "r": "l_"}[name[0]] + name[2:] if name[1] == "_" else name)
        for name in SEGMENT_NAMES
    ]
    one = joint_angles(placed(ADULT, pose, 30.0))
    other = joint_angles(placed(ADULT, Pose(pose.root @ mirror, mirror @ pose.rotations[:, others] @ mirror), 30.0))
    for i, name in enumerate(one.names):
        sideless = name[-2:] not in ("_l", "_r")
        twin = name if sideless else name[:-1] + {"l": "r", "r": "l"}[name[-1]]
        sign = -1 if sideless and name.endswith(("list", "bending", "rotation")) else 1
        np.testing.assert_allclose(
            other.values[:, one.names.index(twin)], sign * one.values[:, i], atol=1e-5, err_msg=name
        )


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), heading=st.floats(-3.0, 3.0))
def test_another_world_changes_the_pelvis_only(seed, heading):
    pose = mixed(seed)
    pelvis = [i for i, name in enumerate(ANGLE_NAMES) if name.startswith("pelvis")]
    before = joint_angles(placed(ADULT, pose, 30.0)).values
    anyhow = Rotation.random(None, np.random.default_rng(seed)).as_matrix()
    turned = joint_angles(placed(ADULT, Pose(pose.root, anyhow @ pose.rotations), 30.0)).values
    np.testing.assert_allclose(np.delete(turned, pelvis, 1), np.delete(before, pelvis, 1), atol=1e-5)
    # About the vertical, only the pelvis' rotation about it.
    round_up = about(UP, np.array([heading]))
    turned = joint_angles(placed(ADULT, Pose(pose.root, round_up @ pose.rotations), 30.0)).values
    change = turned - before
    change[:, pelvis[2]] = np.angle(np.exp(1j * (change[:, pelvis[2]] - heading)))
    np.testing.assert_allclose(change, 0, atol=1e-5)


@pytest.mark.parametrize("up", UP_AXES)
def test_the_up_axis_of_the_world_does_not_matter(up):
    expected = joint_angles(placed(ADULT, mixed(5), 30.0)).values
    np.testing.assert_allclose(joint_angles(placed(ADULT, mixed(5), 30.0, up)).values, expected, atol=1e-6)


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 2**32 - 1))
def test_angles_give_back_the_pose(seed):
    # The Cardan sequence, written with another library: Z, X, Y of ISB are -y, x, z of the body.
    pose = mixed(seed, largest=3.0)
    angles = dict(zip(ANGLE_NAMES, joint_angles(placed(ADULT, pose, 30.0)).values.T, strict=True))
    upright = pose.rotations @ neutral_posture(ADULT).swapaxes(-1, -2)

    def turned(*names_and_axes):
        matrix = np.eye(3)
        for name, axis in names_and_axes:
            matrix = matrix @ about(axis, angles[name])
        return matrix

    def between(parent, child):
        one, other = (upright[:, SEGMENT_NAMES.index(name)] for name in (parent, child))
        return one.swapaxes(-1, -2) @ other

    found = {
        "hip_r": turned(("hip_flexion_r", -LEFT), ("hip_adduction_r", FRONT), ("hip_rotation_r", UP)),
        "knee_l": turned(("knee_angle_l", LEFT), ("knee_adduction_l", -FRONT), ("knee_rotation_l", -UP)),
        "wrist_r": turned(("wrist_flex_r", FRONT), ("wrist_dev_r", LEFT), ("wrist_rot_r", UP)),
        "pelvis": turned(("pelvis_rotation", UP), ("pelvis_list", FRONT), ("pelvis_tilt", -LEFT)),
    }
    expected = {
        "hip_r": between("pelvis", "r_thigh"), "knee_l": between("l_thigh", "l_shank"),
        "wrist_r": between("r_forearm", "r_hand"), "pelvis": upright[:, 0],
    }  # fmt: skip
    for name, matrices in found.items():
        np.testing.assert_allclose(matrices, expected[name], atol=1e-5, err_msg=name)


def test_turning_round_and_raising_an_arm_to_the_side_go_on_over_gaps():
    rounds = np.linspace(0, 6 * np.pi, 100)
    poses = bent("pelvis", about(UP, rounds))
    gaps = (0, 40, 41, 99)
    poses = posed(poses.joints, poses.tips, 30.0, "+Z", gaps, 0, poses.rotations, ADULT)
    found = joint_angles(poses).values
    assert np.isnan(found[list(gaps)]).all()
    seen = np.delete(np.arange(100), gaps)
    np.testing.assert_allclose(found[seen, ANGLE_NAMES.index("pelvis_rotation")], rounds[seen], atol=1e-5)
    raised = np.deg2rad(np.linspace(0, -170, 51))
    found = joint_angles(bent("r_upper_arm", about(FRONT, raised))).values
    np.testing.assert_allclose(found[:, ANGLE_NAMES.index("arm_add_r")], raised, atol=1e-4)


@pytest.mark.parametrize("seed", range(6))
def test_an_arm_comes_back_to_small_angles_after_gimbal_lock(seed):
    # Straight to the side, where noise turns two of three angles at will, round and round; then it hangs.
    rng = np.random.default_rng(seed)
    raised = np.deg2rad(np.concatenate([np.linspace(0, -90, 10), np.full(400, -90), np.linspace(-90, 0, 10)]))
    noise = Rotation.from_rotvec(rng.normal(scale=0.03, size=(420, 3))).as_matrix()
    found = joint_angles(bent("l_upper_arm", noise @ about(-FRONT, raised))).values
    arm = found[:, [ANGLE_NAMES.index(f"arm_{name}_l") for name in ("flex", "add", "rot")]]
    assert np.abs(arm[-1]).max() < 0.2
    np.testing.assert_allclose(arm[-8:, 1], raised[-8:], atol=0.15)


def test_an_arm_that_circles_round_gimbal_lock_does_not_count_turns():
    # Nearly straight to the side, it draws a small circle three times; a limb has not turned, as a whole body has.
    rounds = np.concatenate([np.zeros(10), np.linspace(0, 6 * np.pi, 200), np.full(10, 6 * np.pi)])
    raised = np.deg2rad(np.concatenate([np.linspace(0, -80, 10), np.full(200, -80), np.linspace(-80, 0, 10)]))
    turns = about(-LEFT, rounds) @ about(FRONT, raised) @ about(UP, -rounds)
    found = joint_angles(bent("r_upper_arm", turns)).values
    assert np.abs(found[-1]).max() < 1e-4


def test_gaps_are_nan_and_unknown_rotations_are_refused():
    poses = moving(6, without=(0, 3))
    found = joint_angles(poses)
    assert found.names == ANGLE_NAMES
    np.testing.assert_array_equal(np.isnan(found.values).all(1), ~poses.has_pose)
    assert np.isfinite(found.values[poses.has_pose]).all()
    assert np.isnan(joint_angles(moving(2, without=(0, 1))).values).all()
    with pytest.raises(ValueError, match="hold no rotations"):
        joint_angles(posed(poses.joints, poses.tips, 30.0, "+Z"))
