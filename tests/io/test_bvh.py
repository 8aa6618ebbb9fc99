"""BVH files written from points, played by another program."""

from pathlib import Path

import numpy as np
import pybvh
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.poses import POINT_NAMES, moving, points, posed
from support.shared_data import SHARED

from jaxskel import JOINT_NAMES, Pose, Poses, default_adult, make_skeleton, read_recording
from jaxskel.body import place_joints
from jaxskel.io.mocap import read_bvh
from jaxskel.io.poses import BVH_NAMES, with_up, write_bvh
from jaxskel.io.poses._euler import to_zxy
from jaxskel.io.poses._inverse_kinematics import fit_rig
from jaxskel.io.poses._markers import to_markers
from jaxskel.io.poses._rig import RIG, placed
from jaxskel.io.poses._twist import hinge_across, swung
from jaxskel.recording import UP_AXES

SEQUENCES = SHARED / "sequences"
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
    # Programs that know left and right by names and places find them too.
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
@given(seed=st.integers(0, 2**32 - 1), frames=st.integers(1, 12), hips=st.sampled_from([0.0, 0.001, 0.03]))
def test_whatever_a_skeleton_does_is_met_and_rotations_are_rotations(seed, frames, hips):
    # Any rotation of any segment, even impossible ones; hips in line with the pelvis or below it.
    rng = np.random.default_rng(seed)
    rest = default_adult(rng.uniform(1.4, 2.0))
    joints = np.array(rest.rest_joints)
    joints[9:] -= [0.0, 0.0, hips]
    skeleton = make_skeleton(joints, rest.rest_tips)
    pose = Pose(rng.uniform(-5, 5, (frames, 3)), random_rotations(rng, frames, 17))
    joints, tips = (np.asarray(part, np.float64) for part in place_joints(skeleton, pose))
    rig = fit_rig(joints, tips)
    reached = placed(rig)
    goals = dict(zip(POINT_NAMES, np.concatenate([joints, tips], 1).swapaxes(0, 1), strict=True))
    for i, (name, _, point) in enumerate(RIG):
        if point:
            np.testing.assert_allclose(reached[:, i], goals[point], atol=TENTH_OF_MM, err_msg=name)
    identity = np.broadcast_to(np.eye(3), rig.rotations.shape)
    np.testing.assert_allclose(rig.rotations @ rig.rotations.swapaxes(-1, -2), identity, atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(rig.rotations), 1.0, atol=1e-9)


def test_lengths_that_vary_are_replaced_by_their_median_and_reported(tmp_path):
    exact = moving(9)
    joints = exact.joints.copy()
    thigh = joints[4, 10] - joints[4, 9]
    joints[4, [10, 11]] += 0.03 * thigh / np.linalg.norm(thigh)
    poses = posed(joints, exact.tips, exact.fps, exact.up)
    assert write_bvh(tmp_path / "exact.bvh", exact).deviation < TENTH_OF_MM
    written = write_bvh(tmp_path / "poses.bvh", poses)
    assert written.deviation == pytest.approx(0.03, abs=1e-5)
    assert written.farthest == "l_knee"
    animation, found = played(written.path)
    assert farthest(found, poses, "+Y") == pytest.approx(written.deviation, abs=1e-5)
    np.testing.assert_allclose(played(tmp_path / "exact.bvh")[0].nodes[15].offset, animation.nodes[15].offset, atol=0.1)


@pytest.mark.parametrize("name", ["01_01_female", "05_02_male", "13_29_male", "16_11_male"])
def test_real_motion_of_realistic_bodies_agrees_as_well_as_is_said(tmp_path, name):
    path = SEQUENCES / f"{name}.npz"
    if not path.exists():
        pytest.skip(f"needs sequences/{name}.npz in ../shared/data")
    recording = read_recording(path)
    assert recording.truth is not None
    assert recording.truth.tips is not None
    poses = posed(recording.truth.joints, recording.truth.tips, recording.fps, recording.up)
    written = write_bvh(tmp_path / "poses.bvh", poses)
    _, found = played(written.path)
    assert farthest(found, poses, "+Y") == pytest.approx(written.deviation, abs=1e-5)
    # Their spines bend between pelvis and neck by up to this much; feet and hands are still met.
    assert written.deviation < 0.03
    ends = [POINT_NAMES.index(point) for point in ("l_foot", "r_foot", "l_hand", "r_hand")]
    assert np.linalg.norm((found - points(poses, "+Y"))[:, ends], axis=-1).max() < 0.03


def test_an_elbow_that_is_bent_turns_about_its_hinge_alone():
    poses = moving(60, 5.0)
    rig = fit_rig(*(x.astype(np.float64) for x in (poses.joints, poses.tips)))
    names = [name for name, _, _ in RIG]
    for side, elbow in (("Left", 4), ("Right", 7)):
        upper, lower = (rig.rotations[:, names.index(side + name)] for name in ("Arm", "ForeArm"))
        along = [poses.joints[:, elbow + i] - poses.joints[:, elbow + i - 1] for i in (0, 1)]
        along = [bone / np.linalg.norm(bone, axis=-1, keepdims=True) for bone in along]
        bent = np.linalg.norm(np.cross(*along), axis=-1) > 0.5
        assert bent.sum() > 5
        hinge = np.array([0.0, 0.0, 1.0])
        np.testing.assert_allclose((upper @ hinge)[bent], (lower @ hinge)[bent], atol=1e-3)


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def wandering(rng: np.random.Generator, frames: int) -> np.ndarray:
    """Unit vectors that change by little from frame to frame."""
    return unit(np.cumsum(rng.normal(scale=0.03, size=(frames, 3)), 0) + unit(rng.normal(size=3)))


@pytest.mark.parametrize("seed", range(4))
def test_a_straight_limb_keeps_its_twist_and_a_bent_one_shows_it(seed):
    rng = np.random.default_rng(seed)
    frames = 200
    bones, turns = wandering(rng, frames), random_rotations(rng, 1)
    parents = np.broadcast_to(turns, (frames, 3, 3))
    rest, hinge = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -1.0])
    across = unit(np.cross(bones, wandering(rng, frames)))
    straight = np.zeros(frames, bool)
    straight[60:120] = True
    bends = across * np.where(straight, 0.0, 0.9)[:, None]
    found = hinge_across(bones, bends, parents, rest, hinge, one_way=False)
    np.testing.assert_allclose((found * bones).sum(-1), 0.0, atol=1e-9)
    np.testing.assert_allclose(found[~straight], across[~straight], atol=1e-9)
    # Straight, it is turned no more from frame to frame than its direction is.
    steps = np.linalg.norm(np.diff(found, axis=0), axis=-1)
    swings = np.linalg.norm(np.diff(bones, axis=0), axis=-1)
    assert (steps[60:119] <= swings[60:119] + 1e-9).all()


def test_a_straight_arm_goes_with_a_body_that_turns_beneath_it():
    # Hanging, along the axis about which the body turns once.
    angles = np.linspace(0, 2 * np.pi, 50)
    parents = np.zeros((50, 3, 3))
    parents[:, 0, 0] = parents[:, 1, 1] = np.cos(angles)
    parents[:, 1, 0], parents[:, 0, 1], parents[:, 2, 2] = np.sin(angles), -np.sin(angles), 1.0
    down = np.tile([0.0, 0.0, -1.0], (50, 1))
    rest, hinge = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -1.0])
    found = hinge_across(down, np.zeros((50, 3)), parents, rest, hinge, one_way=False)
    in_body = np.einsum("fji,fj->fi", parents, found)
    np.testing.assert_allclose(in_body, in_body[:1].repeat(50, 0), atol=1e-9)


@pytest.mark.parametrize("away", [0.0, 1e-9, 1e-4, 1.3e-3, 1e-2])
def test_a_bone_that_is_folded_back_is_met_too(away):
    bones = np.array([[np.sin(away), 0.0, -np.cos(away)]])
    found = swung(np.eye(3)[None], np.array([0.0, 0.0, 1.0]), bones)
    np.testing.assert_allclose(found[:, :, 2], bones, atol=1e-9)
    np.testing.assert_allclose(found @ found.swapaxes(-1, -2), np.eye(3)[None], atol=1e-9)


def test_a_knee_that_seems_bent_to_the_front_is_taken_for_straight():
    thigh, hinge = np.array([0.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0])
    bones, parents = np.tile(thigh, (3, 1)), np.tile(np.eye(3), (3, 1, 1))
    bends = np.array([[0.0, 0.9, 0.0], [0.0, -0.3, 0.0], [0.0, -0.9, 0.0]])
    found = hinge_across(bones, bends, parents, thigh, hinge, one_way=True)
    np.testing.assert_allclose(found, np.tile(hinge, (3, 1)), atol=1e-9)


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
    assert not list(tmp_path.iterdir())
