"""The poses that a search starts from: four facings, feet straight and crossed."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from jaxskel import Pose, default_adult
from jaxskel.body import JOINT_NAMES, JOINT_PARENTS, SEGMENT_NAMES, hinge_axes, place_joints, place_segments
from jaxskel.matching import Limbs
from jaxskel.search import graphless_poses, start_poses
from jaxskel.search._start_poses import STARTS, other_ways

ADULT = default_adult()
AT = {name: i for i, name in enumerate(JOINT_NAMES)}
SEGMENT = {name: i for i, name in enumerate(SEGMENT_NAMES)}
FEET = [AT["l_foot"], AT["r_foot"]]
GIVEN = {  # pelvis, neck, left and right foot (m), facing
    "standing": ([0.5, 0, 0.9], [0.5, 0, 1.45], [0.6, 0.12, 0.03], [0.6, -0.12, 0.03], [1, 0, 0]),
    "facing left": ([0, 0, 0.9], [0, 0, 1.45], [-0.12, 0.1, 0.03], [0.12, 0.1, 0.03], [0, 1, 0]),
    "a step": ([0, 0, 0.85], [0.05, 0, 1.4], [0.45, 0.12, 0.03], [-0.3, -0.12, 0.06], [1, 0, 0]),
    "a knee raised": ([0, 0, 0.9], [0, 0, 1.45], [0.3, 0.1, 0.5], [0.1, -0.1, 0.03], [1, 0, 0]),
    "crouching": ([-0.1, 0, 0.35], [0.2, 0, 0.8], [0.15, 0.15, 0.03], [0.15, -0.15, 0.03], [1, 0, 0]),
    "aslant": ([0, 0, 0.9], [0.1, 0.1, 1.4], [0.2, 0.1, 0.03], [0.1, -0.2, 0.03], [0.8, -0.6, 0]),
}


def limbs_of(*names: str) -> Limbs:
    """Labelled limbs with straight paths; hands anywhere."""
    rows = [[np.array(value, float) for value in GIVEN[name]] for name in names]
    count = len(rows)
    paths = np.zeros((count, 5, 32, 3))
    for frame, (pelvis, neck, left, right, _) in enumerate(rows):
        for label, end in enumerate((neck + [0, 0, 0.2], neck + [0, 0.5, 0], neck - [0, 0.5, 0], left, right)):
            paths[frame, label] = np.linspace(pelvis, end, 32)
    inner = np.array([row[:2] for row in rows])
    return Limbs(paths, np.ones((count, 5)), np.ones((count, 5), bool), inner)


def starts_of(*names: str) -> Pose:
    return start_poses(limbs_of(*names), np.array([GIVEN[name][4] for name in names], float), ADULT)


def joints_of(poses: Pose, frame: int = 0) -> np.ndarray:
    """Joints of one frame's starts (m)."""
    return np.asarray(place_joints(ADULT, jax.tree.map(lambda a: a[frame], poses))[0])


def missing(limbs: Limbs, *labels: int) -> Limbs:
    found, paths = limbs.found.copy(), limbs.paths.copy()
    found[:, list(labels)], paths[:, list(labels)] = False, 0.0
    return replace(limbs, found=found, paths=paths)


@pytest.mark.parametrize("name", GIVEN)
def test_eight_starts_keep_the_body_whole(name):
    poses = starts_of(name)
    assert poses.root.shape == (1, 8, 3)
    assert poses.rotations.shape == (1, 8, 17, 3, 3)
    np.testing.assert_array_equal(poses.root[0], np.tile(GIVEN[name][0], (8, 1)))
    turned = poses.rotations
    np.testing.assert_allclose(turned @ turned.swapaxes(-1, -2), np.broadcast_to(np.eye(3), turned.shape), atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(turned), 1.0, atol=1e-9)
    joints = joints_of(poses)
    # Feet that turn with their shanks keep the bones to the balls of the feet as long as they are.
    lengths = np.linalg.norm(joints[:, 1:] - joints[:, list(JOINT_PARENTS[1:])], axis=-1)
    np.testing.assert_allclose(lengths, np.tile(ADULT.bone_lengths, (8, 1)), atol=1e-5)


@pytest.mark.parametrize("name", GIVEN)
def test_starts_face_four_ways_around_the_spine(name):
    rotations = starts_of(name).rotations[0]
    front = rotations[:, 0, :, 0]
    x, y, _ = GIVEN[name][4]
    level = np.array([[x, y], [x, y], [-x, -y], [-x, -y], [-y, x], [-y, x], [y, -x], [y, -x]])
    # If the spine leans, so does the front, but seen from above it has the same direction.
    assert ((front[:, :2] * level).sum(1) > 0.8 * np.linalg.norm(front[:, :2], axis=1)).all()
    np.testing.assert_allclose(front[1::2], front[::2])
    spine = np.subtract(GIVEN[name][1], GIVEN[name][0])
    joints = joints_of(starts_of(name))
    along = joints[:, AT["neck"]] - joints[:, AT["pelvis"]]
    length = np.linalg.norm(ADULT.rest_joints[AT["neck"]])
    np.testing.assert_allclose(along, np.tile(length * spine / np.linalg.norm(spine), (8, 1)), atol=1e-5)


@pytest.mark.parametrize("name", GIVEN)
def test_feet_are_near_where_the_graph_has_them_straight_and_crossed(name):
    joints, given = joints_of(starts_of(name)), np.array(GIVEN[name][2:4])
    for start in range(8):
        feet = joints[start, FEET]
        straight, crossed = (np.linalg.norm(feet - given[order], axis=1).max() for order in ([0, 1], [1, 0]))
        assert min(straight, crossed) < 0.2  # the ball of the foot is 0.12 m ahead of the ankle wherever the shank is
    # The first start follows the graph's labels, the second has the feet exchanged.
    first, second = joints[:2, FEET]
    assert np.linalg.norm(first - given, axis=1).max() < 0.12
    assert np.linalg.norm(second - given[::-1], axis=1).max() < 0.12


@pytest.mark.parametrize("name", GIVEN)
def test_knees_bend_as_hinges_and_to_the_front(name):
    poses = jax.tree.map(lambda a: a[0], starts_of(name))
    rotations, joints = poses.rotations, joints_of(starts_of(name))
    axes = np.asarray(hinge_axes(ADULT))[2:]
    for side, axis in zip("lr", axes, strict=True):
        thigh, shank, foot = (rotations[:, SEGMENT[f"{side}_{part}"]] for part in ("thigh", "shank", "foot"))
        relative = thigh.swapaxes(1, 2) @ shank
        np.testing.assert_allclose(relative @ axis, np.tile(axis, (8, 1)), atol=1e-6)
        np.testing.assert_array_equal(foot, shank)
        ankles = np.asarray(jax.vmap(place_segments, (None, 0))(ADULT, poses)[2])[:, SEGMENT[f"{side}_foot"]]
        hip, knee = joints[:, AT[f"{side}_hip"]], joints[:, AT[f"{side}_knee"]]
        way = (ankles - hip) / np.linalg.norm(ankles - hip, axis=1, keepdims=True)
        ahead, front = (a - (a * way).sum(1, keepdims=True) * way for a in (knee - hip, rotations[:, 0, :, 0]))
        # The knee stands before the line from hip to ankle.
        front /= np.linalg.norm(front, axis=1, keepdims=True)
        length = np.linalg.norm(ahead, axis=1)
        assert length.min() > 0.02
        np.testing.assert_allclose((ahead * front).sum(1), length, rtol=0.01)  # by its rest, a shank leans a little


def test_arms_are_as_at_rest():
    rotations = starts_of("aslant").rotations[0]
    for name in ("chest", "head", "l_clavicle", "l_upper_arm", "r_forearm", "l_hand", "r_hand"):
        np.testing.assert_array_equal(rotations[:, SEGMENT[name]], rotations[:, 0])


def test_feet_that_change_sides_with_the_front_are_straight_again():
    # Facing back, the foot on the body's left is the one labelled right.
    joints, given = joints_of(starts_of("standing")), np.array(GIVEN["standing"][2:4])
    assert np.linalg.norm(joints[2, FEET] - given[::-1], axis=1).max() < 0.2
    assert np.linalg.norm(joints[3, FEET] - given, axis=1).max() < 0.2


def test_a_missing_foot_is_beside_the_other():
    limbs = limbs_of("standing", "a step")
    facing = np.array([[1.0, 0, 0]] * 2)
    for label, other in ((3, 4), (4, 3)):
        poses = start_poses(missing(limbs, label), facing, ADULT)
        for frame in range(2):
            feet = joints_of(poses, frame)[:, FEET]
            assert np.linalg.norm(feet - limbs.ends[frame, other], axis=-1).max() < 0.2


def test_missing_feet_are_below_the_pelvis():
    limbs = limbs_of("standing", "aslant")
    poses = start_poses(missing(limbs, 3, 4), np.array([[1.0, 0, 0]] * 2), ADULT)
    for frame in range(2):
        feet = joints_of(poses, frame)[:, FEET]
        assert np.isfinite(feet).all()
        below = limbs.pelvis[frame] - [0, 0, 0.5 * ADULT.stature]
        assert np.linalg.norm(feet - below, axis=-1).max() < 0.2


def test_without_facing_or_spine_the_axes_of_the_world_stand_in():
    limbs = limbs_of("standing")
    nowhere = replace(limbs, inner=limbs.inner[:, [0, 0]] + [[0.0] * 3, [0.01, 0.0, 0.0]])
    poses = start_poses(nowhere, np.zeros((1, 3)), ADULT)
    expected = start_poses(limbs, np.array([[1.0, 0.0, 0.0]]), ADULT)
    np.testing.assert_allclose(poses.rotations, expected.rotations, atol=1e-9)


def test_frames_do_not_depend_on_each_other():
    together = starts_of(*GIVEN)
    for frame, name in enumerate(GIVEN):
        alone = starts_of(name)
        np.testing.assert_allclose(together.rotations[frame], alone.rotations[0], atol=1e-12)


def test_a_foot_straight_below_or_above_the_hip_gives_numbers():
    # The front is then across nothing, or along the leg.
    for foot in ([0.0, 0.09, 0.03], [0.9, 0.09, 0.9], [0.0, 0.09, 1.6], [0.0, 0.09, 0.9]):
        limbs = limbs_of("standing")
        limbs.paths[0, 3, -1] = np.array(foot) + [0.5, 0, 0]
        assert np.isfinite(start_poses(limbs, np.array([[1.0, 0, 0]]), ADULT).rotations).all()


# Where another pose was found


def test_other_ways_are_those_of_a_graph_with_the_same_pelvis_neck_and_feet():
    found = joints_of(starts_of("standing"))
    again = other_ways(found[:1].astype(np.float64), ADULT)
    assert again.rotations.shape == (1, STARTS, 17, 3, 3)
    joints = joints_of(again)
    # The first is what was found; the third faces the other way and stands on the same places.
    np.testing.assert_allclose(joints[0], found[0], atol=0.08)
    left, right = (JOINT_NAMES.index(f"{side}_foot") for side in "lr")
    np.testing.assert_allclose(joints[2][[left, right]], found[0][[right, left]], atol=0.15)
    across = [JOINT_NAMES.index(f"{side}_hip") for side in "lr"]
    np.testing.assert_allclose(joints[2][across], joints[0][across[::-1]], atol=1e-6)
    # A person who faces up has no front direction; any is accepted.
    lying = found[:1].copy()
    lying[0, across[0]] = lying[0, across[1]]
    assert np.isfinite(other_ways(lying, ADULT).rotations).all()


# Where the graph fails


def test_graphless_poses_stand_and_crouch_in_the_middle_and_face_four_ways():
    middles = np.array([[0.5, -0.2, 0.9], [-1.0, 2.0, 1.1]])
    poses = graphless_poses(middles, ADULT)
    assert poses.root.shape == (2, 28, 3)
    assert poses.rotations.shape == (2, 28, 17, 3, 3)
    np.testing.assert_array_equal(poses.root[:, :4], np.repeat(middles[:, None], 4, 1))
    np.testing.assert_allclose(poses.rotations[:, :4, 0, :, 0], [[[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]] * 2)
    np.testing.assert_allclose(np.linalg.det(poses.rotations), 1.0)
    for frame, middle in enumerate(middles):
        # The template as it stands, turned about the vertical through its pelvis.
        joints, rest = joints_of(poses, frame), ADULT.rest_joints
        np.testing.assert_allclose(joints[0], middle + rest, atol=1e-6)
        for way in (0, 4):
            first = joints[way] - middle
            np.testing.assert_allclose(joints[way + 1], middle + turned(first, 1), atol=1e-6)
            np.testing.assert_allclose(joints[way + 2], middle + turned(first, 2), atol=1e-6)
            np.testing.assert_allclose(joints[way + 3], middle + turned(first, 3), atol=1e-6)


def test_graphless_poses_stand_on_the_head_and_lie():
    trunks = graphless_poses(np.zeros((1, 3)), ADULT).rotations[0, :, 0]
    up, front = trunks[:, :, 2], trunks[:, :, 0]
    np.testing.assert_allclose(up[8:12], [[0, 0, -1]] * 4, atol=1e-12)
    np.testing.assert_allclose(up[12:, 2], 0, atol=1e-12)
    # On the belly, on the back, then on the sides, the head to all four sides.
    np.testing.assert_allclose(front[12:, 2], [-1] * 4 + [1] * 4 + [0] * 8, atol=1e-12)
    cube = np.delete(trunks, range(4, 8), axis=0)
    assert len({tuple(np.round(turn).astype(int).ravel()) for turn in cube}) == 24
    assert len({tuple(np.round(way).astype(int)) for way in up[12:16]}) == 4


def test_a_body_that_lies_is_turned_about_its_spine():
    lying = joints_of(starts_of("standing"))[:1].astype(np.float64) @ np.array([[0, 0, -1.0], [0, 1, 0], [1, 0, 0]]).T
    poses = other_ways(lying, ADULT)
    spines = poses.rotations[0, :, 1, :, 2]
    np.testing.assert_allclose(spines, np.broadcast_to(spines[0], spines.shape), atol=0.05)
    fronts = poses.rotations[0, ::2, 0, :, 0]
    np.testing.assert_allclose(
        fronts @ fronts.T, [[1, -1, 0, 0], [-1, 1, 0, 0], [0, 0, 1, -1], [0, 0, -1, 1]], atol=1e-6
    )


def turned(joints: np.ndarray, quarters: int) -> np.ndarray:
    return joints @ np.linalg.matrix_power(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), quarters).T


def test_who_crouches_has_raised_thighs_and_stands_on_feet_below_the_pelvis():
    joints = dict(zip(JOINT_NAMES, joints_of(graphless_poses(np.zeros((1, 3)), ADULT), 0)[4], strict=True))
    pelvis = joints["pelvis"]
    for side in ("l_", "r_"):
        assert joints[side + "knee"][2] > joints[side + "hip"][2]
        assert joints[side + "knee"][0] > joints[side + "hip"][0] + 0.3
        assert joints[side + "foot"][2] < pelvis[2] - 0.15
        assert 0 < joints[side + "foot"][0] - pelvis[0] < 0.45
    # Bent forward, the middle of the body above and in front of the pelvis.
    assert joints["neck"][0] > pelvis[0] + 0.1
    assert pelvis[0] < 0 > pelvis[2]
