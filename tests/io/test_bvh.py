"""BVH, written from rotations, played by other people's program."""

from pathlib import Path

import numpy as np
import pybvh
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.poses import POINT_NAMES, moving, placed, points, posed

from jaxskel import JOINT_NAMES, Pose, Poses, default_adult, make_skeleton
from jaxskel._math.euler import to_zxy
from jaxskel.body import SEGMENT_NAMES, hinge_axes, place_joints
from jaxskel.io.mocap import read_bvh
from jaxskel.io.poses import BVH_NAMES, with_up, write_bvh
from jaxskel.io.poses._markers import to_markers
from jaxskel.io.poses._rig import RIG, Rig, rig_of
from jaxskel.io.poses._rig import placed as rig_placed
from jaxskel.recording import UP_AXES

TENTH_OF_MM = 1e-4
ENDS = {"head_top": "Head", "l_fingertip": "LeftPalm", "r_fingertip": "RightPalm", "l_toetip": "LeftToeBase",
        "r_toetip": "RightToeBase"}  # fmt: skip


def played(path: Path, scale: float = 0.01) -> tuple[pybvh.Bvh, np.ndarray]:
    """The animation, and its points (m) in the order of those of poses."""
    animation = pybvh.Bvh.from_file(str(path))
    names = [f"EndSite{ENDS[name]}" if name in ENDS else BVH_NAMES[name] for name in POINT_NAMES]
    return animation, animation.node_positions()[:, [animation.node_index[name] for name in names]] * scale


def farthest(found: np.ndarray, poses: Poses, up: str) -> float:
    """Greatest distance (m) from the poses where there are some."""
    distances = np.linalg.norm(found - to_markers(with_up(poses, up)).positions, axis=-1)
    return float(distances[poses.has_pose].max())


@pytest.mark.parametrize("fps", [5.0, 29.97, 120.0])
@pytest.mark.parametrize("frames", [1, 30])
def test_pybvh_finds_the_same_joints_rate_unit_and_up_axis(tmp_path, fps, frames):
    poses = moving(frames, fps, up="+Z")
    written = write_bvh(tmp_path / "new" / "my poses.bvh", poses)
    assert written.held == 0
    animation, found = played(written.path)
    np.testing.assert_allclose(found, points(poses, "+Y"), atol=TENTH_OF_MM)
    assert (animation.frame_count, animation.world_up_inferred, animation.rest_up) == (frames, "+y", "+y")
    # So are left and right by programs that know them by names and places.
    assert animation.lr_mapping["LeftForeArm"] == "RightForeArm"
    assert animation.fps == pytest.approx(fps, rel=1e-6)
    # A bone as long as in the poses, but in centimetres.
    thigh = 100 * np.linalg.norm(poses.joints[0, 10] - poses.joints[0, 9])
    assert np.linalg.norm(animation.nodes[animation.node_index["LeftLeg"]].offset) == pytest.approx(thigh, rel=1e-5)


@pytest.mark.parametrize("up", UP_AXES)
def test_any_world_is_written_into_any_other_at_any_scale(tmp_path, up):
    poses = moving(8, up="-X")
    written = write_bvh(tmp_path / "poses.bvh", poses, up=up, scale=0.0254)
    _, found = played(written.path, 0.0254)
    assert farthest(found, poses, up) < TENTH_OF_MM
    motion = read_bvh(written.path, scale=0.0254, up=up)
    assert motion.fps == pytest.approx(poses.fps)
    joints = motion.positions[:, [motion.names.index(BVH_NAMES[name]) for name in JOINT_NAMES]]
    np.testing.assert_allclose(joints, with_up(poses, up).joints, atol=TENTH_OF_MM)
    # At rest a T-pose that stands upright, wherever up is.
    sign, axis = (1 if up[0] == "+" else -1), "XYZ".index(up[1])
    rest = dict(zip(motion.names, sign * motion.rest[:, axis], strict=True))
    assert rest["LeftToeBase"] < rest["LeftFoot"] < rest["LeftLeg"] < rest["LeftUpLeg"] < rest["Neck"] < rest["Head"]
    assert rest["LeftPalm"] == pytest.approx(rest["LeftArm"], abs=1e-6)


def test_gaps_hold_the_pose_before_and_are_counted(tmp_path):
    poses = moving(12, without=(0, 1, 5, 6, 11))
    written = write_bvh(tmp_path / "poses.bvh", poses)
    assert written.held == 5
    _, found = played(written.path)
    shown = [2, 2, 2, 3, 4, 4, 4, 7, 8, 9, 10, 10]
    np.testing.assert_allclose(found, points(poses, "+Y")[shown], atol=TENTH_OF_MM)


def random_rotations(rng: np.random.Generator, *shape: int) -> np.ndarray:
    q, r = np.linalg.qr(rng.normal(size=(*shape, 3, 3)))
    q = q * np.sign(np.diagonal(r, axis1=-2, axis2=-1))[..., None, :]
    return q * np.linalg.det(q)[..., None, None]


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), hips=st.sampled_from([0.0, 0.001, 0.03]), bent=st.floats(0, 0.2))
def test_whatever_a_skeleton_does_is_met_and_rotations_are_rotations(seed, hips, bent):
    # Any rotation of any segment, as no person could; hips in line with the pelvis or below it; limbs bent at rest.
    rng = np.random.default_rng(seed)
    rest = default_adult(rng.uniform(1.4, 2.0))
    joints = np.array(rest.rest_joints)
    joints[9:] -= [0.0, 0.0, hips]
    joints[1:] += rng.uniform(-bent, bent, (14, 3)) / 2
    skeleton = make_skeleton(joints, rest.rest_tips)
    pose = Pose(rng.uniform(-5, 5, (8, 3)), random_rotations(rng, 8, 17))
    joints, tips = (np.asarray(part, np.float64) for part in place_joints(skeleton, pose))
    rig = rig_of(skeleton, pose)
    reached = rig_placed(rig)
    goals = dict(zip(POINT_NAMES, np.concatenate([joints, tips], 1).swapaxes(0, 1), strict=True))
    for i, (name, _, point, _) in enumerate(RIG):
        if point in goals:
            np.testing.assert_allclose(reached[:, i], goals[point], atol=1e-5, err_msg=name)
    identity = np.broadcast_to(np.eye(3), rig.rotations.shape)
    np.testing.assert_allclose(rig.rotations @ rig.rotations.swapaxes(-1, -2), identity, atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(rig.rotations), 1.0, atol=1e-9)
    # At rest, arms to the sides and legs down, whatever the template's rest; they do not bend to the front or back.
    still = Rig(rig.rows, rig.offsets, np.zeros((1, 3)), np.tile(np.eye(3), (1, len(RIG), 1, 1)))
    at = dict(zip([name for name, *_ in RIG], rig_placed(still)[0], strict=True))
    for start, end, way in (
        ("LeftArm", "LeftForeArm", (0, 1, 0)), ("LeftForeArm", "LeftPalm", (0, 1, 0)),
        ("RightArm", "RightForeArm", (0, -1, 0)), ("RightHand", "RightPalm", (0, -1, 0)),
        ("LeftUpLeg", "LeftLeg", (0, 0, -1)), ("RightLeg", "RightFoot", (0, 0, -1)),
    ):  # fmt: skip
        bone = at[end] - at[start]
        bone /= np.linalg.norm(bone)
        assert bone[0] == pytest.approx(0.0, abs=1e-9)
        if start in ("LeftArm", "RightArm", "LeftUpLeg"):
            np.testing.assert_allclose(bone, way, atol=1e-9, err_msg=end)
        assert bone @ way > 0
    ahead = at["LeftToetip"] - at["LeftFoot"]
    assert ahead[0] > 0
    assert ahead[1] == pytest.approx(0.0, abs=1e-9)


def test_lengths_that_vary_are_replaced_by_the_templates_and_reported(tmp_path):
    exact = moving(9)
    joints = exact.joints.copy()
    thigh = joints[4, 10] - joints[4, 9]
    joints[4, [10, 11]] += 0.03 * thigh / np.linalg.norm(thigh)
    poses = posed(joints, exact.tips, exact.fps, exact.up, rotations=exact.rotations, skeleton=exact.skeleton)
    assert write_bvh(tmp_path / "exact.bvh", exact).deviation < TENTH_OF_MM
    written = write_bvh(tmp_path / "poses.bvh", poses)
    assert written.deviation == pytest.approx(0.03, abs=1e-5)
    assert written.farthest == "l_knee"
    assert farthest(played(written.path)[1], poses, "+Y") == pytest.approx(written.deviation, abs=1e-5)
    assert written.path.read_bytes() == (tmp_path / "exact.bvh").read_bytes()


# Angles about z, x and y of the file, where +Y is up and the person faces +Z at rest.
HINGES = {"LeftForeArm": (2, -1), "RightForeArm": (2, 1), "LeftLeg": (1, 1), "RightLeg": (1, 1)}


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 2**32 - 1))
def test_elbows_and_knees_turn_about_one_axis(tmp_path_factory, seed):
    rng, skeleton, frames = np.random.default_rng(seed), default_adult(), 9
    angles = np.deg2rad(rng.uniform(0, 130, (frames, 4)))
    rotations = random_rotations(rng, frames, 17)
    rotations[:, :3] = np.eye(3)  # upright, or pybvh warns
    upper, lower = (
        ("l_upper_arm", "r_upper_arm", "l_thigh", "r_thigh"),
        ("l_forearm", "r_forearm", "l_shank", "r_shank"),
    )
    for i, (above, below, axis) in enumerate(zip(upper, lower, hinge_axes(skeleton), strict=True)):
        bend = Rotation.from_rotvec(angles[:, i, None] * axis).as_matrix()
        rotations[:, SEGMENT_NAMES.index(below)] = rotations[:, SEGMENT_NAMES.index(above)] @ bend
    poses = placed(skeleton, Pose(rng.normal(size=(frames, 3)), rotations), 25.0)
    animation, _ = played(write_bvh(tmp_path_factory.mktemp("hinges") / "a.bvh", poses).path)
    for i, (name, (axis, sign)) in enumerate(HINGES.items()):
        found = animation.joint_angles[:, animation.joint_index[name]]
        expected = np.zeros((frames, 3))
        expected[:, axis] = sign * angles[:, i]
        # The template's shanks are not quite straight below its thighs.
        assert np.abs(found[0] - expected[0]).max() < 0.01
        np.testing.assert_allclose(found - found[0], expected - expected[0], atol=2e-5, err_msg=name)


def test_angles_go_on_from_frame_to_frame(tmp_path):
    animation, _ = played(write_bvh(tmp_path / "a.bvh", moving(360, 30.0)).path)
    steps = np.abs(np.diff(animation.joint_angles, axis=0))
    # The fastest is a thigh in front of the body, where two axes of three fall together.
    assert steps.max() < np.deg2rad(90)
    elbows = [animation.joint_index[name] for name in ("LeftForeArm", "RightForeArm")]
    assert steps[:, elbows].max() < np.deg2rad(20)


def by_angles(angles: np.ndarray) -> np.ndarray:
    """Turns about z, x and y, the first outermost, from the definition."""
    sines, cosines = np.sin(angles), np.cos(angles)
    turns = []
    for i, axis in enumerate((2, 0, 1)):
        j, k = (axis + 1) % 3, (axis + 2) % 3
        turn = np.zeros((*angles.shape[:-1], 3, 3))
        turn[..., axis, axis] = 1
        turn[..., j, j] = turn[..., k, k] = cosines[..., i]
        turn[..., k, j], turn[..., j, k] = sines[..., i], -sines[..., i]
        turns.append(turn)
    return turns[0] @ turns[1] @ turns[2]


def test_angles_give_their_rotations_also_where_two_axes_fall_together():
    rng = np.random.default_rng(0)
    rotations = random_rotations(rng, 50, 4)
    locked = rng.uniform(-3, 3, (50, 4, 3))
    locked[..., 1] = np.pi / 2 * np.sign(locked[..., 1])
    for each in (rotations, by_angles(locked), np.broadcast_to(np.eye(3), (5, 2, 3, 3))):
        np.testing.assert_allclose(by_angles(to_zxy(each)), each, atol=1e-9)


@pytest.mark.parametrize("axis", range(3))
def test_angles_do_not_jump_where_a_joint_turns_round_and_round(axis):
    angles = np.zeros((200, 1, 3))
    angles[:, 0, axis] = np.linspace(0, 6 * np.pi, 200)
    steps = np.abs(np.diff(to_zxy(by_angles(angles)), axis=0))
    assert steps.max() < 1.1 * 6 * np.pi / 199


def test_what_cannot_be_animated_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no frame has a pose"):
        write_bvh(tmp_path / "poses.bvh", moving(2, without=(0, 1)))
    with pytest.raises(ValueError, match="up axis 'up'"):
        write_bvh(tmp_path / "poses.bvh", moving(2), up="up")
    for scale in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="metres per unit"):
            write_bvh(tmp_path / "poses.bvh", moving(2), scale=scale)
    exact = moving(2)
    with pytest.raises(ValueError, match=r"poses.bvh: the poses hold no rotations.*reconstruct again"):
        write_bvh(tmp_path / "poses.bvh", posed(exact.joints, exact.tips, exact.fps, exact.up))
    assert not list(tmp_path.iterdir())
