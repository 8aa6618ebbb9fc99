import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxskel.body import (
    JOINT_NAMES,
    JOINT_OF_PIVOT,
    JOINT_PARENTS,
    MIRROR_JOINTS,
    PIVOT_NAMES,
    SEGMENT_NAMES,
    SEGMENT_OF_JOINT,
    SEGMENT_OF_PIVOT,
    SEGMENT_OF_TIP,
    SEGMENT_PARENTS,
    TIP_NAMES,
    TIP_PARENTS,
    Pose,
    default_adult,
    forward_kinematics,
    hinge_axes,
    make_skeleton,
    place_segments,
    rest_origins,
)
from jaxskel.body._human import MIRROR_TIPS

ADULT = default_adult()
MIRROR = np.diag([1.0, -1.0, 1.0])
kinematics = jax.jit(forward_kinematics)
segments = jax.jit(place_segments)
CARRIERS = [SEGMENT_PARENTS[segment] for segment in SEGMENT_OF_PIVOT]
"""Forearms and shanks, in the order of the pivots."""


def random_pose(seed) -> Pose:
    rng = np.random.default_rng(seed)
    return Pose(rng.normal(size=3), Rotation.random(17, rng).as_matrix())


@pytest.mark.parametrize("seed", range(5))
def test_kinematics_keep_bone_lengths(seed):
    pose = random_pose(seed)
    pose.rotations[list(SEGMENT_OF_PIVOT)] = pose.rotations[CARRIERS]
    joints, tips = (np.asarray(a, np.float64) for a in kinematics(ADULT, pose))
    np.testing.assert_allclose(
        np.linalg.norm(joints[1:] - joints[list(JOINT_PARENTS[1:])], axis=1), ADULT.bone_lengths, atol=1e-6
    )
    np.testing.assert_allclose(np.linalg.norm(tips - joints[list(TIP_PARENTS)], axis=1), ADULT.tip_lengths, atol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_turned_hands_and_feet_keep_the_lengths_on_both_sides_of_their_pivots(seed):
    joints, tips, origins = (np.asarray(a, np.float64) for a in segments(ADULT, random_pose(seed)))
    lengths = np.linalg.norm(joints[1:] - joints[list(JOINT_PARENTS[1:])], axis=1)
    ends = [joint - 1 for joint in JOINT_OF_PIVOT]
    np.testing.assert_allclose(np.delete(lengths, ends), np.delete(ADULT.bone_lengths, ends), atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(tips - joints[list(TIP_PARENTS)], axis=1), ADULT.tip_lengths, atol=1e-6)
    beyond = list(JOINT_OF_PIVOT)
    before = [JOINT_PARENTS[joint] for joint in beyond]
    for others in (before, beyond):
        placed = np.linalg.norm(origins[list(SEGMENT_OF_PIVOT)] - joints[others], axis=1)
        np.testing.assert_allclose(placed, np.linalg.norm(ADULT.pivots - ADULT.rest_joints[others], axis=1), atol=1e-6)


def test_kinematics_at_rest():
    root = np.array([1.0, -2.0, 0.5])
    joints, tips = kinematics(ADULT, Pose(root, np.tile(np.eye(3), (17, 1, 1))))
    np.testing.assert_allclose(joints, ADULT.rest_joints + root, atol=1e-6)
    np.testing.assert_allclose(tips, ADULT.rest_tips + root, atol=1e-6)


def test_kinematics_of_a_turned_body():
    turn = Rotation.from_euler("zyx", (0.3, -1.2, 2.0)).as_matrix()
    joints, tips = kinematics(ADULT, Pose(np.zeros(3), np.tile(turn, (17, 1, 1))))
    np.testing.assert_allclose(joints, ADULT.rest_joints @ turn.T, atol=1e-6)
    np.testing.assert_allclose(tips, ADULT.rest_tips @ turn.T, atol=1e-6)


@pytest.mark.parametrize(
    ("segment", "moving"),
    [("l_hand", {"l_hand", "l_fingertip"}), ("r_hand", {"r_hand", "r_fingertip"}),
     ("l_foot", {"l_foot", "l_toetip"}), ("r_foot", {"r_foot", "r_toetip"})],
)  # fmt: skip
def test_a_turned_hand_or_foot_moves_what_is_beyond_its_pivot_only(segment, moving):
    pose = random_pose(7)
    before = [np.asarray(a) for a in segments(ADULT, pose)]
    turn, number = Rotation.from_euler("xyz", (0.4, 0.5, -0.7)).as_matrix(), SEGMENT_NAMES.index(segment)
    pose.rotations[number] = turn @ pose.rotations[number]
    after = [np.asarray(a) for a in segments(ADULT, pose)]
    shifts = np.linalg.norm(np.concatenate(after[:2]) - np.concatenate(before[:2]), axis=1)
    names = np.array(JOINT_NAMES + TIP_NAMES)
    assert set(names[shifts > 1e-3]) == moving
    np.testing.assert_array_equal(shifts[~np.isin(names, list(moving))], 0.0)
    # Wrist and ankle stay, and what moves turns about them.
    np.testing.assert_array_equal(after[2], before[2])
    joint, pivot = JOINT_NAMES.index(segment), after[2][number]
    np.testing.assert_allclose(after[0][joint] - pivot, turn @ (before[0][joint] - pivot), atol=1e-6)


def test_segments_turn_about_their_origins():
    at_rest = Pose(np.array([1.0, -2.0, 0.5]), np.tile(np.eye(3), (17, 1, 1)))
    origins = np.asarray(segments(ADULT, at_rest)[2])
    np.testing.assert_allclose(origins, rest_origins(ADULT) + at_rest.root, atol=1e-6)
    named = dict(zip(JOINT_NAMES + PIVOT_NAMES, np.vstack([ADULT.rest_joints, ADULT.pivots]), strict=True))
    about = {"pelvis": "pelvis", "chest": "pelvis", "head": "neck", "clavicle": "neck", "upper_arm": "shoulder",
             "forearm": "elbow", "hand": "wrist", "thigh": "hip", "shank": "knee", "foot": "ankle"}  # fmt: skip
    for name, origin in zip(SEGMENT_NAMES, rest_origins(ADULT), strict=True):
        sided = name[:2] in ("l_", "r_")
        where = about[name[2:] if sided else name]
        point = named[name[:2] + where if sided and where != "neck" else where]
        np.testing.assert_array_equal(origin, point, err_msg=name)


def test_pivots_by_hand():
    at = dict(zip(JOINT_NAMES, ADULT.rest_joints, strict=True))
    l_wrist, r_wrist, l_ankle, r_ankle = ADULT.pivots
    np.testing.assert_allclose(l_wrist, 0.71 * at["l_hand"] + 0.29 * at["l_elbow"], atol=1e-12)
    # 1.72 m tall: 122 mm behind and 46 mm above the ball of the foot, three quarters of the way out to it.
    np.testing.assert_allclose(l_ankle[[0, 2]] - at["l_foot"][[0, 2]], [-0.12212, 0.04644], atol=1e-9)
    np.testing.assert_allclose(l_ankle[1], 0.25 * at["l_knee"][1] + 0.75 * at["l_foot"][1], atol=1e-12)
    np.testing.assert_allclose([r_wrist, r_ankle], [l_wrist @ MIRROR, l_ankle @ MIRROR], atol=1e-12)
    np.testing.assert_allclose(ADULT.scaled(0.5).pivots, 0.5 * ADULT.pivots, atol=1e-12)


def test_pivots_and_axes_are_the_same_in_jax():
    single = jax.tree.map(lambda a: jnp.asarray(a, jnp.float32), ADULT)
    for of in (lambda s: s.pivots, rest_origins, hinge_axes):
        assert isinstance(of(ADULT), np.ndarray)
        np.testing.assert_allclose(eqx.filter_jit(of)(single), of(ADULT), atol=1e-6)


def test_a_positive_angle_bends_elbows_to_the_front_and_knees_to_the_back():
    axes = hinge_axes(ADULT)
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1.0, atol=1e-12)
    # Across an arm that hangs 30 degrees off the trunk.
    np.testing.assert_allclose(axes[0], [0, -np.sqrt(0.75), -0.5], atol=1e-7)
    for axis, (upper, middle), pivot, front in zip(
        axes, ((3, 4), (6, 7), (9, 10), (12, 13)), ADULT.pivots, (1, 1, -1, -1), strict=True
    ):
        joints = ADULT.rest_joints
        np.testing.assert_allclose(axis @ (joints[middle] - joints[upper]), 0.0, atol=1e-7)
        lower = pivot - joints[middle]
        bent = Rotation.from_rotvec(np.pi / 2 * axis).as_matrix() @ lower
        assert front * bent[0] > 0.99 * np.linalg.norm(lower)


def test_one_segment_moves_what_hangs_on_it():
    rest = Pose(np.zeros(3), np.tile(np.eye(3), (17, 1, 1)))
    before = np.concatenate(kinematics(ADULT, rest))
    for segment, name in enumerate(SEGMENT_NAMES):
        rest.rotations[segment] = Rotation.from_euler("xyz", (0.4, 0.5, -0.7)).as_matrix()
        moved = np.linalg.norm(np.concatenate(kinematics(ADULT, rest)) - before, axis=1) > 1e-4
        rest.rotations[segment] = np.eye(3)
        # A joint moves if a bone on its way to the pelvis does, or the part of it beyond a pivot; no rotation is
        # inherited.
        carried = [segment == SEGMENT_OF_JOINT[joint] and joint > 0 for joint in range(15)]
        if segment in SEGMENT_OF_PIVOT:
            carried[JOINT_OF_PIVOT[SEGMENT_OF_PIVOT.index(segment)]] = True
        for joint in range(1, 15):
            carried[joint] |= carried[JOINT_PARENTS[joint]]
        carried += [carried[joint] or segment == SEGMENT_OF_TIP[tip] for tip, joint in enumerate(TIP_PARENTS)]
        np.testing.assert_array_equal(moved, carried, err_msg=name)


def test_the_tables_agree():
    assert len(JOINT_NAMES) == len(JOINT_PARENTS) == len(SEGMENT_OF_JOINT) == len(MIRROR_JOINTS) == 15
    assert len(TIP_NAMES) == len(TIP_PARENTS) == len(SEGMENT_OF_TIP) == 5
    assert all(parent < joint for joint, parent in enumerate(JOINT_PARENTS))
    assert len(SEGMENT_NAMES) == len(SEGMENT_PARENTS) == len(set(SEGMENT_NAMES)) == 17
    assert all(parent < segment for segment, parent in enumerate(SEGMENT_PARENTS))
    assert len(PIVOT_NAMES) == len(JOINT_OF_PIVOT) == len(SEGMENT_OF_PIVOT) == 4
    for name, joint, segment in zip(PIVOT_NAMES, JOINT_OF_PIVOT, SEGMENT_OF_PIVOT, strict=True):
        # A pivot splits the bone that ends in its joint; what lies beyond is named after that joint.
        assert JOINT_NAMES[joint] == SEGMENT_NAMES[segment]
        assert SEGMENT_PARENTS[segment] == SEGMENT_OF_JOINT[joint]
        assert {"wrist": "hand", "ankle": "foot"}[name[2:]] == SEGMENT_NAMES[segment][2:]
        assert SEGMENT_OF_TIP[TIP_PARENTS.index(joint)] == segment
    for joint in range(1, 15):
        segment, parent = SEGMENT_OF_JOINT[joint], SEGMENT_OF_JOINT[JOINT_PARENTS[joint]]
        # The bone's segment is its parent's bone's, or hangs on it.
        assert segment == parent or SEGMENT_PARENTS[segment] == parent
    for names, mirror in ((JOINT_NAMES, MIRROR_JOINTS), (TIP_NAMES, MIRROR_TIPS)):
        for name, other in zip(names, mirror, strict=True):
            sides = {"l_": "r_", "r_": "l_"}
            assert names[other] == (sides[name[:2]] + name[2:] if name[:2] in sides else name)


@pytest.mark.parametrize("stature", [1.5, 1.72, 2.0])
def test_default_adult_is_as_tall_as_asked_for(stature):
    assert abs(default_adult(stature).stature - stature) < 1e-3
    assert abs(default_adult(stature).rest_tips[0, 2] - default_adult(stature).rest_tips[3, 2] - stature) < 1e-3


def test_default_adult_is_a_person():
    at = dict(zip(JOINT_NAMES + TIP_NAMES, np.vstack([ADULT.rest_joints, ADULT.rest_tips]), strict=True))
    np.testing.assert_array_equal(at["pelvis"], 0.0)
    np.testing.assert_allclose(ADULT.rest_joints[list(MIRROR_JOINTS)] @ MIRROR, ADULT.rest_joints, atol=1e-12)
    np.testing.assert_allclose(ADULT.rest_tips[list(MIRROR_TIPS)] @ MIRROR, ADULT.rest_tips, atol=1e-12)
    assert all(at[name][1] > 0 for name in at if name.startswith("l_"))  # left is +y
    assert at["l_toetip"][0] > at["l_foot"][0] > at["l_knee"][0]  # the feet point to +x
    down_the_body = ["head_top", "head", "neck", "l_shoulder", "pelvis", "l_knee", "l_foot", "l_toetip"]
    # de Leva's upper arm, forearm with half the hand, in a straight arm that hangs 30 degrees off the trunk.
    upper, lower = at["l_elbow"] - at["l_shoulder"], at["l_hand"] - at["l_elbow"]
    np.testing.assert_allclose(lower / 0.179, upper / 0.162, rtol=1e-9)
    np.testing.assert_allclose(upper / np.linalg.norm(upper), [0, 0.5, -np.sqrt(0.75)], atol=1e-9)
    heights = [at[name][2] for name in down_the_body]
    assert heights == sorted(heights, reverse=True)


def test_scaled():
    half = ADULT.scaled(0.5)
    np.testing.assert_allclose(half.bone_lengths, 0.5 * ADULT.bone_lengths)
    np.testing.assert_allclose(half.tip_lengths, 0.5 * ADULT.tip_lengths)
    np.testing.assert_allclose(half.stature, 0.5 * ADULT.stature)


def test_make_skeleton_puts_the_pelvis_at_the_origin():
    moved = make_skeleton(ADULT.rest_joints + [1, 2, 3], ADULT.rest_tips + [1, 2, 3])
    np.testing.assert_allclose(moved.rest_joints, ADULT.rest_joints, atol=1e-12)
    np.testing.assert_allclose(moved.rest_tips, ADULT.rest_tips, atol=1e-12)


def spoiled(**changes):
    joints, tips = ADULT.rest_joints.copy(), ADULT.rest_tips.copy()
    for name, value in changes.items():
        joints[JOINT_NAMES.index(name)] = value
    return joints, tips


@pytest.mark.parametrize(
    ("joints", "tips", "complaint"),
    [
        (ADULT.rest_joints[:14], ADULT.rest_tips, r"not \(14, 3\) and \(5, 3\)"),
        (ADULT.rest_joints, ADULT.rest_tips.T, r"not \(15, 3\) and \(3, 5\)"),
        (*spoiled(l_knee=np.nan), "NaN or infinity"),
        (ADULT.rest_joints, np.full((5, 3), np.inf), "NaN or infinity"),
        (1000 * ADULT.rest_joints, 1000 * ADULT.rest_tips, "give metres"),
        (ADULT.rest_joints / 10, ADULT.rest_tips / 10, "give metres"),
        (ADULT.rest_joints[:, [0, 2, 1]], ADULT.rest_tips[:, [0, 2, 1]], "z up"),
        (*spoiled(l_elbow=ADULT.rest_joints[3]), "ends in l_elbow is shorter than 1 cm"),
    ],
)
def test_make_skeleton_refuses(joints, tips, complaint):
    with pytest.raises(ValueError, match=complaint):
        make_skeleton(joints, tips)
