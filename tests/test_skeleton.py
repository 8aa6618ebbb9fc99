import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxskel._rotations import aligning, exponential, frame
from jaxskel._skeleton import (
    JOINT_NAMES,
    JOINT_PARENTS,
    MIRROR_JOINTS,
    MIRROR_TIPS,
    SEGMENT_NAMES,
    SEGMENT_OF_JOINT,
    SEGMENT_OF_TIP,
    SEGMENT_PARENTS,
    TIP_NAMES,
    TIP_PARENTS,
    Pose,
    default_adult,
    forward_kinematics,
    make_skeleton,
)

ADULT = default_adult()
MIRROR = np.diag([1.0, -1.0, 1.0])
kinematics = jax.jit(forward_kinematics)


def random_pose(seed) -> Pose:
    rng = np.random.default_rng(seed)
    return Pose(rng.normal(size=3), Rotation.random(13, rng=rng).as_matrix())


@pytest.mark.parametrize("seed", range(5))
def test_kinematics_keep_bone_lengths(seed):
    joints, tips = (np.asarray(a, np.float64) for a in kinematics(ADULT, random_pose(seed)))
    np.testing.assert_allclose(
        np.linalg.norm(joints[1:] - joints[list(JOINT_PARENTS[1:])], axis=1), ADULT.bone_lengths, atol=1e-6
    )
    np.testing.assert_allclose(np.linalg.norm(tips - joints[list(TIP_PARENTS)], axis=1), ADULT.tip_lengths, atol=1e-6)


def test_kinematics_at_rest():
    root = np.array([1.0, -2.0, 0.5])
    joints, tips = kinematics(ADULT, Pose(root, np.tile(np.eye(3), (13, 1, 1))))
    np.testing.assert_allclose(joints, ADULT.rest_joints + root, atol=1e-6)
    np.testing.assert_allclose(tips, ADULT.rest_tips + root, atol=1e-6)


def test_kinematics_of_a_turned_body():
    turn = Rotation.from_euler("zyx", (0.3, -1.2, 2.0)).as_matrix()
    joints, tips = kinematics(ADULT, Pose(np.zeros(3), np.tile(turn, (13, 1, 1))))
    np.testing.assert_allclose(joints, ADULT.rest_joints @ turn.T, atol=1e-6)
    np.testing.assert_allclose(tips, ADULT.rest_tips @ turn.T, atol=1e-6)


def test_one_segment_moves_what_hangs_on_it():
    rest = Pose(np.zeros(3), np.tile(np.eye(3), (13, 1, 1)))
    before = np.concatenate(kinematics(ADULT, rest))
    for segment, name in enumerate(SEGMENT_NAMES):
        rest.rotations[segment] = Rotation.from_euler("xyz", (0.4, 0.5, -0.7)).as_matrix()
        moved = np.linalg.norm(np.concatenate(kinematics(ADULT, rest)) - before, axis=1) > 1e-4
        rest.rotations[segment] = np.eye(3)
        # A joint moves if a bone on its way to the pelvis does; no rotation is inherited.
        carried = [segment == SEGMENT_OF_JOINT[joint] and joint > 0 for joint in range(15)]
        for joint in range(1, 15):
            carried[joint] |= carried[JOINT_PARENTS[joint]]
        carried += [carried[joint] or segment == SEGMENT_OF_TIP[tip] for tip, joint in enumerate(TIP_PARENTS)]
        np.testing.assert_array_equal(moved, carried, err_msg=name)


def test_the_tables_agree():
    assert len(JOINT_NAMES) == len(JOINT_PARENTS) == len(SEGMENT_OF_JOINT) == len(MIRROR_JOINTS) == 15
    assert len(TIP_NAMES) == len(TIP_PARENTS) == len(SEGMENT_OF_TIP) == 5
    assert all(parent < joint for joint, parent in enumerate(JOINT_PARENTS))
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


VECTORS = {
    "random": np.random.default_rng(0).normal(size=(20, 3)),
    "tiny": 1e-5 * np.random.default_rng(1).normal(size=(20, 3)),
    "where the series ends": 1e-4 * np.array([[0.999, 0, 0], [0, 1.001, 0]]),
    "half turn": np.pi * np.eye(3),
    "more than a turn": np.array([[0.0, 7.0, 0.0]]),
    "zero": np.zeros((1, 3)),
}


@pytest.mark.parametrize("vectors", VECTORS)
def test_exponential_is_scipys(vectors):
    expected = Rotation.from_rotvec(VECTORS[vectors]).as_matrix()
    with jax.enable_x64(True):
        np.testing.assert_allclose(exponential(jnp.asarray(VECTORS[vectors])), expected, atol=1e-12)
    single = exponential(jnp.asarray(VECTORS[vectors], jnp.float32))
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, expected, atol=1e-6)


def test_exponential_is_smooth_at_zero():
    derivative = jax.jacfwd(exponential)(jnp.zeros(3))
    # The generators of rotations: d R / d x_k has the entries -epsilon_ijk.
    epsilon = np.zeros((3, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        epsilon[i, j, k], epsilon[j, i, k] = 1.0, -1.0
    np.testing.assert_allclose(derivative, -epsilon, atol=1e-7)
    np.testing.assert_allclose(jax.jacrev(exponential)(jnp.zeros(3)), -epsilon, atol=1e-7)
    second = jax.hessian(lambda v: exponential(v)[0, 0])(jnp.zeros(3))
    np.testing.assert_allclose(second, np.diag([0.0, -1.0, -1.0]), atol=1e-6)


def test_aligning_takes_start_to_goal_by_the_smallest_turn():
    rng = np.random.default_rng(4)
    start, goal = rng.normal(size=(2, 40, 3))
    start /= np.linalg.norm(start, axis=1, keepdims=True)
    goal /= np.linalg.norm(goal, axis=1, keepdims=True)
    goal[:10] = -start[:10]  # opposite
    goal[10:13] = start[10:13]  # the same
    goal[13:16] = -start[13:16] + 4e-3 * goal[13:16]  # nearly opposite
    goal[16:19] = -start[16:19] + 1e-4 * goal[16:19]  # so nearly that the axis is arbitrary
    goal /= np.linalg.norm(goal, axis=1, keepdims=True)
    turn = aligning(start, goal)
    turned = np.einsum("nij,nj->ni", turn, start)
    np.testing.assert_allclose(turned[16:19], goal[16:19], atol=2e-4)
    np.testing.assert_allclose(np.delete(turned, np.s_[16:19], 0), np.delete(goal, np.s_[16:19], 0), atol=1e-6)
    np.testing.assert_allclose(turn @ turn.swapaxes(1, 2), np.tile(np.eye(3), (40, 1, 1)), atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(turn), 1.0, atol=1e-6)
    angle = np.arccos(np.clip((start * goal).sum(1), -1, 1))
    np.testing.assert_allclose(Rotation.from_matrix(turn).magnitude(), angle, atol=2e-4)
    np.testing.assert_allclose(aligning(np.eye(3)[0], np.eye(3)[1]), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)


def test_frame_by_hand():
    # Leaning to the front by 45 degrees, with a left that is not quite across.
    up, left = np.array([1.0, 0.0, 1.0]), np.array([0.3, 1.0, 0.3])
    r = np.sqrt(0.5)
    np.testing.assert_allclose(frame(up, left), [[r, 0, r], [0, 1, 0], [-r, 0, r]], atol=1e-12)
