"""The whole method on a scene of our own: accuracy, laws of space, failures as data.

Grids, cameras and statuses are tested without the search, which takes far longer.
"""

import equinox as eqx
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.recordings import graph_settings, mirrored, moved, with_hull, with_known_body, with_masks

from jaxskel import (
    JOINT_PARENTS,
    Poses,
    Recording,
    Settings,
    Status,
    default_adult,
    join_poses,
    make_body,
    paper_settings,
    prepare,
    reconstruct,
    reconstruct_batches,
)
from jaxskel.body import JOINT_OF_PIVOT, MIRROR_JOINTS, TIP_PARENTS, place_joints
from jaxskel.matching import DtwMatcher, ExactMatcher
from jaxskel.poses import score
from jaxskel.synthetic import camera_ring, make_scene

GRAPH = graph_settings()


@pytest.fixture(scope="module")
def scene() -> Recording:
    """The whole motion of twelve seconds in one batch of frames."""
    return make_scene(8, fps=8 / 12)


@pytest.fixture(scope="module")
def poses(scene) -> Poses:
    return reconstruct(scene, with_known_body(scene))


@pytest.fixture(scope="module")
def longer() -> Recording:
    return make_scene(16, fps=16 / 12)


@pytest.fixture(scope="module")
def of_graph(scene) -> Poses:
    return reconstruct(scene, GRAPH)


def distances_mm(a, b):
    return 1e3 * np.linalg.norm(np.asarray(a, float) - np.asarray(b, float), axis=-1)


def bones(joints):
    return np.linalg.norm(joints[:, 1:] - joints[:, list(JOINT_PARENTS[1:])], axis=-1)


def names(poses: Poses) -> list[str]:
    return [Status(s).name for s in poses.status]


def lengths_of_tips(poses: Poses) -> np.ndarray:
    return np.linalg.norm(poses.tips - poses.joints[:, list(TIP_PARENTS)], axis=-1)


# Accuracy


@pytest.mark.slow
def test_default_finds_every_joint_and_the_body_of_the_subject(scene):
    prepared = prepare(scene, Settings())
    poses = join_poses(reconstruct_batches(scene, Settings(), prepared))
    assert poses.has_pose.all()
    d = distances_mm(poses.joints, scene.truth.joints)
    # The scene's body is a mean of two; the prior is of 160 others, whose joint centres sit elsewhere in the flesh.
    assert np.median(d) < 15
    assert d.max() < 50
    # The body is calibrated on these frames, so it differs from the average adult's.
    average = make_body(scene.skeleton)
    assert np.abs(np.asarray(prepared.body.radii) - average.radii).max() > 0.003
    np.testing.assert_array_equal(prepared.body.skeleton.rest_joints, scene.skeleton.rest_joints)
    assert 0 < prepared.costs.low <= prepared.costs.typical


def test_a_given_body_and_the_papers_method_need_no_calibration(scene):
    body = make_body(scene.skeleton)
    for recording, settings in ((scene, Settings(body=body)), (scene, paper_settings())):
        prepared = prepare(recording, settings)
        assert prepared.costs is None
        np.testing.assert_array_equal(prepared.body.radii, body.radii)


@pytest.mark.parametrize("matcher", [DtwMatcher(), ExactMatcher()])
def test_graph_alone_finds_most_joints(longer, matcher):
    poses = reconstruct(longer, graph_settings(matcher))
    result = score(poses.joints.astype(float), longer.truth.joints, poses.has_pose)
    assert poses.has_pose.all()
    assert 1e3 * result.percentile(50) < 25
    assert 1e3 * result.percentile(50, "r_foot") < 25
    assert result.all_correct() > 0.85
    assert result.wrong("head") == 0


def test_left_and_right_are_told_apart(scene, poses):
    right_way = distances_mm(poses.joints, scene.truth.joints)[:, [9, 12]].sum(1)
    other_way = distances_mm(poses.joints[:, MIRROR_JOINTS], scene.truth.joints)[:, [9, 12]].sum(1)
    assert (right_way < other_way).all()
    assert ((poses.side_confidence >= 0.5) & (poses.side_confidence <= 1)).all()


def test_joints_far_from_the_truth_are_trusted_less():
    seen_by_few = make_scene(24, fps=2.0, cameras=camera_ring(3))
    poses = reconstruct(seen_by_few, paper_settings())  # it mistakes a raised hand for the head
    off = distances_mm(poses.joints, seen_by_few.truth.joints)  # NaN where there is no pose
    assert (off > 100).sum() > 20
    assert poses.confidence[off > 100].mean() < poses.confidence[off <= 100].mean() - 0.2
    assert ((poses.confidence >= 0) & (poses.confidence <= 1)).all()


# Bones


def test_without_pivots_all_bones_have_exactly_the_lengths_of_the_template(scene, of_graph):
    skeleton = scene.skeleton
    np.testing.assert_allclose(bones(of_graph.joints), np.tile(skeleton.bone_lengths, (8, 1)), atol=2e-6)
    np.testing.assert_allclose(lengths_of_tips(of_graph), np.tile(skeleton.tip_lengths, (8, 1)), atol=2e-6)


def test_by_default_rigid_parts_have_exactly_the_lengths_of_the_template(scene, poses):
    skeleton = scene.skeleton
    bent = np.array(JOINT_OF_PIVOT) - 1  # bones with a wrist or an ankle inside
    np.testing.assert_allclose(
        np.delete(bones(poses.joints), bent, 1), np.tile(np.delete(skeleton.bone_lengths, bent), (8, 1)), atol=2e-6
    )
    np.testing.assert_allclose(lengths_of_tips(poses), np.tile(skeleton.tip_lengths, (8, 1)), atol=2e-6)
    # From elbow to palm and from knee to ball of the foot: a triangle with the pivot.
    near, joints = np.asarray(skeleton.rest_joints), np.array(JOINT_OF_PIVOT)
    upper = np.linalg.norm(skeleton.pivots - near[joints - 1], axis=-1)
    lower = np.linalg.norm(skeleton.pivots - near[joints], axis=-1)
    across = bones(poses.joints)[:, bent]
    assert (across <= upper + lower + 2e-6).all()
    assert (across >= np.abs(upper - lower)).all()
    # Hands and feet are straight in this scene.
    assert np.abs(across - skeleton.bone_lengths[bent]).max() < 0.03


def test_rotations_lead_from_the_template_to_the_joints(scene, poses, of_graph):
    for found in (poses, of_graph):
        np.testing.assert_array_equal(found.skeleton.rest_joints, scene.skeleton.rest_joints)
        joints, tips = place_joints(found.skeleton, found.pose)
        np.testing.assert_allclose(found.joints, joints, atol=5e-6)
        np.testing.assert_allclose(found.tips, tips, atol=5e-6)
        np.testing.assert_allclose(np.linalg.det(found.rotations), 1.0, atol=1e-5)


# Laws of space


def test_mirrored_scene_gives_the_mirrored_pose(scene, poses):
    other = reconstruct(mirrored(scene), with_known_body(scene))
    d = distances_mm(other.joints[:, MIRROR_JOINTS] * [1, -1, 1], poses.joints)
    # The mirror reverses the order in which rays through the outlines are drawn.
    assert np.median(d) < 5
    assert d.max() < 25


def test_mirrored_scene_gives_the_mirrored_pose_by_the_graph(scene, of_graph):
    other = reconstruct(mirrored(scene), GRAPH)
    d = distances_mm(other.joints[:, MIRROR_JOINTS] * [1, -1, 1], of_graph.joints)
    # Ties between equal clusters are broken by voxel order, which the mirror reverses: a few frames differ.
    assert np.median(d) < 2
    assert (d.max(1) < 50).mean() > 0.85


def test_moved_world_gives_the_moved_pose(scene, poses):
    rotation = Rotation.from_euler("x", 180, degrees=True) * Rotation.from_euler("z", 37, degrees=True)
    shift = np.array([0.51, -1.207, 0.303])
    other = reconstruct(moved(scene, rotation.as_matrix(), shift, "-Z"), with_known_body(scene))
    assert other.up == "-Z"
    d = distances_mm(other.joints, poses.joints @ rotation.as_matrix().T + shift)
    np.testing.assert_allclose(place_joints(other.skeleton, other.pose)[0], other.joints, atol=5e-6)
    assert np.median(d) < 1
    assert d.max() < 10


@pytest.mark.parametrize(
    ("axis", "angle", "shift", "up", "median"),
    [
        ("z", 90, (0.0, 0.0, 0.0), "+Z", 1.0),
        ("z", 37, (0.51, -1.207, 0.303), "+Z", 15.0),
        ("x", -90, (0.0, 0.0, 0.0), "+Y", 1.0),
        ("y", -90, (0.3, 0.15, 0.0), "-X", 5.0),  # reverses the order of the voxels, as the mirror does
    ],
)
def test_moved_world_gives_the_moved_pose_by_the_graph(scene, of_graph, axis, angle, shift, up, median):
    rotation = Rotation.from_euler(axis, angle, degrees=True).as_matrix()
    other = reconstruct(moved(scene, rotation, np.array(shift), up), GRAPH)
    assert other.up == up
    d = distances_mm(other.joints, of_graph.joints @ rotation.T + shift)
    assert np.median(d) < median
    assert (d.max(1) < 80).mean() > 0.8


@pytest.mark.slow
@pytest.mark.parametrize("up", ["+Z", "-Y"])
def test_box_can_be_given_in_the_world_of_the_recording(scene, of_graph, up):
    turn = {"+Z": Rotation.identity(), "-Y": Rotation.from_euler("x", 90, degrees=True)}[up].as_matrix()
    corners = np.array([[-1.2, -1.2, -0.1], [1.2, 1.2, 2.4]]) @ turn.T
    box = np.stack([corners.min(0), corners.max(0)])
    other = reconstruct(moved(scene, turn, np.zeros(3), up), with_hull(GRAPH, box=box))
    assert np.median(distances_mm(other.joints, of_graph.joints @ turn.T)) < 1


# Frames and batches


def test_by_the_graph_each_frame_is_reconstructed_by_itself(scene, of_graph):
    prepared = prepare(scene, GRAPH)
    alone = next(iter(reconstruct_batches(scene[5:6], GRAPH, prepared)))
    # The solver runs in float32, and XLA sums in another order for another frame of the batch.
    assert distances_mm(alone.joints[0], of_graph.joints[5]).max() < 1


def test_batches_cover_every_frame_in_order(scene, of_graph):
    frames = np.arange(33) % 8
    long = eqx.tree_at(lambda r: (r.silhouettes, r.frame_index), scene, (scene.silhouettes[frames], 5 + np.arange(33)))
    parts = list(reconstruct_batches(long, GRAPH))
    assert [len(part) for part in parts] == [32, 1]
    joined = join_poses(parts)
    assert joined.frame_index.tolist() == list(range(5, 38))
    assert distances_mm(joined.joints, of_graph.joints[frames]).max() < 1


def test_unknown_subject_is_scaled_to_its_stature():
    subject = default_adult(1.55)
    recording = make_scene(8, skeleton=subject)
    prepared = prepare(eqx.tree_at(lambda r: r.skeleton, recording, None), GRAPH)
    assert not prepared.skeleton_is_known
    assert prepared.skeleton.stature == pytest.approx(subject.stature, rel=0.05)


# Failures are data


def test_lost_views_are_left_out_and_empty_frames_have_no_pose(scene, poses):
    masks = scene.silhouettes.copy()
    masks[1, 2] = 0
    masks[5] = 0
    masks[7, 2:] = 0
    other = reconstruct(with_masks(scene, masks), with_known_body(scene))
    assert names(other)[1] == "VIEW_LOST"
    assert names(other)[5] == "EMPTY"
    assert names(other)[7] == "TOO_FEW_VIEWS"
    assert np.isnan(other.joints[[5, 7]]).all()
    assert (other.confidence[[5, 7]] == 0).all()
    assert distances_mm(other.joints[1], poses.joints[1]).max() < 30
    unharmed = [0, 2, 3, 4, 6]
    assert distances_mm(other.joints[unharmed], poses.joints[unharmed]).max() < 1


def test_lost_views_and_empty_frames_by_the_graph(scene, of_graph):
    masks = scene.silhouettes.copy()
    masks[1, 2] = 0
    masks[5] = 0
    masks[7, 2:] = 0
    other = reconstruct(with_masks(scene, masks), GRAPH)
    assert [names(other)[frame] for frame in (1, 5, 7)] == ["VIEW_LOST", "EMPTY", "TOO_FEW_VIEWS"]
    assert np.median(distances_mm(other.joints[1], of_graph.joints[1])) < 30
    unharmed = [0, 2, 3, 4, 6]
    assert distances_mm(other.joints[unharmed], of_graph.joints[unharmed]).max() < 1
