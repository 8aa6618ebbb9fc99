"""Poses of other skeletons than the paper's human: filters, relative rotations, datasets, parts put together."""

from dataclasses import replace

import numpy as np
import pytest
from support.live_sessions import step_of
from support.templates import acting, animal, hand

from jaxskel.body import place_joints
from jaxskel.poses import join_poses, smooth

OTHERS = pytest.mark.parametrize("skeleton", [hand(), animal()], ids=["hand", "animal"])


@OTHERS
def test_filtered_rotations_lead_to_the_filtered_points(skeleton):
    poses = acting(skeleton, 60)
    found = smooth(poses, 3.0)
    joints, tips = place_joints(skeleton, found.pose)
    np.testing.assert_allclose(found.joints, joints, atol=2e-6)
    np.testing.assert_allclose(found.tips, tips, atol=2e-6)
    assert np.abs(np.diff(found.tips, 2, axis=0)).mean() < np.abs(np.diff(poses.tips, 2, axis=0)).mean()
    assert found.template == skeleton.template


@OTHERS
def test_bones_keep_their_lengths_where_rotations_are_unknown(skeleton):
    poses = replace(acting(skeleton, 60), rotations=None, skeleton=None)
    found, parents = smooth(poses, 3.0), skeleton.template.point_parents
    points = np.concatenate([found.joints, found.tips], 1)
    lengths = np.linalg.norm(points[:, 1:] - points[:, parents[1:]], axis=-1)
    pivoted = [pivot.joint - 1 for pivot in skeleton.template.pivots]
    wanted = np.concatenate([skeleton.bone_lengths, skeleton.tip_lengths])
    np.testing.assert_allclose(*(np.delete(a, pivoted, -1) for a in (lengths, np.tile(wanted, (60, 1)))), atol=2e-6)


@OTHERS
def test_relative_rotations_lead_to_the_same_ones(skeleton):
    poses = acting(skeleton)
    turns = list(poses.local_rotations.swapaxes(0, 1))
    for segment, parent in enumerate(skeleton.template.segment_parents):
        turns[segment] = turns[segment] if parent < 0 else turns[parent] @ turns[segment]
    np.testing.assert_allclose(np.stack(turns, 1), poses.rotations, atol=2e-6)


@OTHERS
def test_a_dataset_has_the_names_of_the_template(skeleton):
    pytest.importorskip("xarray")
    poses = acting(skeleton)
    dataset = poses.to_xarray()
    assert dataset.keypoints.values.tolist() == list(skeleton.template.point_names)
    tip = dataset.position.sel(keypoints=skeleton.template.tip_names[-1], individuals="person", space="z")
    np.testing.assert_array_equal(tip.values, poses.tips[:, -1, 2])


def test_only_parts_of_one_template_are_put_together():
    poses = acting(animal(), 6, without=(2,))
    whole = join_poses([step_of(poses, row) for row in range(6)])
    assert whole.template == poses.template
    np.testing.assert_array_equal(whole.rotations, poses.rotations)
    with pytest.raises(ValueError, match="animal and three-fingered hand differ; join parts of one recording"):
        join_poses([poses, acting(hand(), 2)])
