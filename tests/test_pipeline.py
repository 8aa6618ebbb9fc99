"""The whole method on a scene of our own: accuracy, laws of space, failures as data."""

import equinox as eqx
import numpy as np
import pytest
from scenes import mirrored, moved, with_masks
from scipy.spatial.transform import Rotation

from jaxskel import (
    DtwMatcher,
    ExactMatcher,
    Poses,
    Settings,
    Status,
    default_adult,
    make_skeleton,
    paper_settings,
    prepare,
    reconstruct,
    reconstruct_batches,
)
from jaxskel._skeleton import MIRROR_JOINTS
from jaxskel.metrics import score
from jaxskel.synthetic import demo_motion, make_scene


@pytest.fixture(scope="module")
def scene():
    return make_scene(32)


@pytest.fixture(scope="module")
def poses(scene):
    return reconstruct(scene)


def distances_mm(a, b):
    return 1e3 * np.linalg.norm(np.asarray(a, float) - np.asarray(b, float), axis=-1)


def bones(joints):
    from jaxskel import JOINT_PARENTS

    return np.linalg.norm(joints[:, 1:] - joints[:, list(JOINT_PARENTS[1:])], axis=-1)


@pytest.mark.parametrize("matcher", [DtwMatcher(), ExactMatcher()])
def test_scene_is_reconstructed(scene, matcher):
    poses = reconstruct(scene, Settings(matcher=matcher))
    result = score(poses.joints.astype(float), scene.truth.joints, poses.has_pose)
    assert poses.has_pose.all()
    assert 1e3 * result.percentile(50) < 25
    assert 1e3 * result.percentile(50, "r_foot") < 25
    assert result.all_correct() > 0.85
    assert result.wrong("head") == 0


def test_bones_have_exactly_the_lengths_of_the_template(scene, poses):
    np.testing.assert_allclose(bones(poses.joints), np.tile(scene.skeleton.bone_lengths, (32, 1)), atol=2e-6)


def test_left_and_right_are_told_apart(scene, poses):
    right_way = distances_mm(poses.joints, scene.truth.joints)[:, [9, 12]].sum(1)
    other_way = distances_mm(poses.joints[:, MIRROR_JOINTS], scene.truth.joints)[:, [9, 12]].sum(1)
    assert (right_way < other_way).mean() > 0.95
    assert ((poses.side_confidence >= 0.5) & (poses.side_confidence <= 1)).all()


def test_joints_far_from_the_truth_are_trusted_less(scene):
    poses = reconstruct(scene, paper_settings())  # takes a raised hand for the head
    far = distances_mm(poses.joints, scene.truth.joints) > 100
    assert far.sum() > 10
    assert poses.confidence[far].mean() < poses.confidence[~far].mean() - 0.3
    assert ((poses.confidence >= 0) & (poses.confidence <= 1)).all()


def test_mirrored_scene_gives_the_mirrored_pose(scene, poses):
    other = reconstruct(mirrored(scene))
    d = distances_mm(other.joints[:, MIRROR_JOINTS] * [1, -1, 1], poses.joints)
    # Ties between equal clusters are broken by voxel order, which a mirror turns round: a few frames differ.
    assert np.median(d) < 2
    assert (d.max(1) < 50).mean() > 0.85


@pytest.mark.parametrize(
    ("axis", "angle", "shift", "up", "median"),
    [
        ("z", 90, (0.0, 0.0, 0.0), "+Z", 1.0),
        ("z", 37, (0.51, -1.207, 0.303), "+Z", 15.0),
        ("x", -90, (0.0, 0.0, 0.0), "+Y", 1.0),
        ("x", 180, (0.0, 0.0, 0.0), "-Z", 1.0),
        ("y", -90, (0.3, 0.15, 0.0), "-X", 1.0),
    ],
)
def test_moved_world_gives_the_moved_pose(scene, poses, axis, angle, shift, up, median):
    rotation = Rotation.from_euler(axis, angle, degrees=True).as_matrix()
    other = reconstruct(moved(scene, rotation, np.array(shift), up))
    assert other.up == up
    d = distances_mm(other.joints, poses.joints @ rotation.T + shift)
    assert np.median(d) < median
    assert (d.max(1) < 80).mean() > 0.8


def test_each_frame_is_reconstructed_by_itself(scene, poses):
    prepared = prepare(scene, Settings())
    alone = next(iter(reconstruct_batches(scene[20:21], prepared=prepared)))
    # The solver runs in float32, and XLA sums in another order for another frame of the batch.
    assert distances_mm(alone.joints[0], poses.joints[20]).max() < 1


def test_batches_cover_every_frame_in_order(scene):
    long = make_scene(33)
    parts = list(reconstruct_batches(long))
    assert [len(part) for part in parts] == [32, 1]
    assert np.concatenate([part.frame_index for part in parts]).tolist() == list(range(33))


def test_unknown_subject_is_scaled_to_its_stature():
    subject = default_adult(1.55)
    recording = make_scene(16, skeleton=subject)
    prepared = prepare(eqx.tree_at(lambda r: r.skeleton, recording, None), Settings())
    assert not prepared.skeleton_is_known
    assert prepared.skeleton.stature == pytest.approx(subject.stature, rel=0.05)


@pytest.mark.parametrize("up", ["+Z", "-Y"])
def test_box_can_be_given_in_the_world_of_the_recording(scene, poses, up):
    turn = {"+Z": Rotation.identity(), "-Y": Rotation.from_euler("x", 90, degrees=True)}[up].as_matrix()
    corners = np.array([[-1.2, -1.2, -0.1], [1.2, 1.2, 2.4]]) @ turn.T
    box = np.stack([corners.min(0), corners.max(0)])
    other = reconstruct(moved(scene, turn, np.zeros(3), up), Settings(box=box))
    assert np.median(distances_mm(other.joints, poses.joints @ turn.T)) < 1


def test_person_outside_of_the_box_has_no_pose(scene):
    poses = reconstruct(scene, Settings(box=np.array([[-1.2, -1.2, -0.1], [1.2, 1.2, 1.3]])))
    assert not poses.has_pose.any()
    assert "PARTLY_OUTSIDE" in names(poses)


def names(poses: Poses) -> list[str]:
    return [Status(s).name for s in poses.status]


def test_lost_views_are_left_out_and_empty_frames_have_no_pose(scene, poses):
    masks = scene.silhouettes.copy()
    masks[3, 2] = 0
    masks[5] = 0
    masks[7, 2:] = 0
    other = reconstruct(with_masks(scene, masks))
    assert names(other)[3] == "VIEW_LOST"
    assert names(other)[5] == "EMPTY"
    assert names(other)[7] == "TOO_FEW_VIEWS"
    assert np.isnan(other.joints[[5, 7]]).all()
    assert (other.confidence[[5, 7]] == 0).all()
    assert np.median(distances_mm(other.joints[3], poses.joints[3])) < 30
    unharmed = np.setdiff1d(np.arange(32), [3, 5, 7])
    assert distances_mm(other.joints[unharmed], poses.joints[unharmed]).max() < 1


def test_noise_specks_are_no_person(scene):
    masks = np.zeros_like(scene.silhouettes)
    masks[:, :, 100:103, 10] = 0xFF
    assert set(names(reconstruct(with_masks(scene, masks)))) == {"EMPTY"}


def test_black_recording_is_empty_throughout(scene):
    poses = reconstruct(with_masks(scene, np.zeros_like(scene.silhouettes)))
    assert set(names(poses)) == {"EMPTY"}
    assert np.isnan(poses.joints).all()


def test_several_people_get_no_pose(scene, poses):
    skeleton = scene.skeleton
    motion = demo_motion(skeleton, 32)
    beside = eqx.tree_at(lambda m: m.root, motion, np.asarray(motion.root) + [0.0, 1.0, 0.0])
    guest = make_scene(32, skeleton=skeleton, motion=beside)
    masks = scene.silhouettes.copy()
    masks[10:14] |= guest.silhouettes[10:14]
    other = reconstruct(with_masks(scene, masks))
    assert set(names(other)[10:14]) == {"SEVERAL_PEOPLE"}
    unharmed = np.setdiff1d(np.arange(32), np.arange(10, 14))
    assert np.median(distances_mm(other.joints[unharmed], poses.joints[unharmed])) < 1


@pytest.mark.parametrize("step_aside", [2.0, 2.5])
def test_person_half_outside_gets_no_invented_pose(scene, step_aside):
    motion = demo_motion(scene.skeleton, 8)
    aside = eqx.tree_at(lambda m: m.root, motion, np.asarray(motion.root) + [step_aside, 0.0, 0.0])
    recording = make_scene(8, skeleton=scene.skeleton, motion=aside)
    assert set(names(reconstruct(recording))) == {"PARTLY_OUTSIDE"}


def test_masks_cut_in_half_give_no_pose(scene):
    masks = scene.silhouettes.copy()
    masks[6, :, masks.shape[2] // 2 :] = 0
    masks[8, :, :, : masks.shape[3] // 2] = 0
    other = reconstruct(with_masks(scene, masks))
    assert not other.has_pose[[6, 8]].any()


def test_dimensions_of_somebody_else_are_refused(scene):
    child = make_skeleton(0.5 * np.asarray(scene.skeleton.rest_joints), 0.5 * np.asarray(scene.skeleton.rest_tips))
    poses = reconstruct(eqx.tree_at(lambda r: r.skeleton, scene[:8], child))
    assert set(names(poses)) == {"NO_MATCH"}


def test_voting_forgives_a_hole_in_one_view(scene):
    masks = scene.silhouettes.copy()
    masks[:, 0, 200:300] = 0  # a stripe across the body in one view cuts every hull in two
    holed = with_masks(scene, masks)
    strict, voted = reconstruct(holed), reconstruct(holed, Settings(max_misses=1))
    assert (~strict.has_pose).mean() > 0.5
    assert voted.has_pose.mean() > 0.9
