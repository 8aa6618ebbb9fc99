"""Other templates through the whole method: a human's points after a search, and bodies that are no humans."""

from dataclasses import replace

import numpy as np
import pytest
from support.poses import moving
from templates import errors, right_labels, scene_of

import jaxskel as js
from jaxskel.body import JOINT_NAMES, default_adult, place_joints
from jaxskel.io.templates import built_in, hand, human_21
from jaxskel.pipeline import Settings, paper_settings, prepare, reconstruct
from jaxskel.pipeline._carried import carried


def test_points_of_a_template_on_the_human_body():
    poses = moving(frames=6, without=(2,))
    joints, noise = len(JOINT_NAMES), np.random.default_rng(0).uniform(1e-5, 1e-3, (6, len(JOINT_NAMES), 1, 1))
    poses = replace(poses, covariance=noise * np.eye(3), confidence=np.linspace(0, 1, 6 * joints).reshape(6, joints))
    found = carried(poses, human_21().template)
    names = found.template.joint_names
    for name in set(names) & set(JOINT_NAMES):
        here, there = names.index(name), JOINT_NAMES.index(name)
        np.testing.assert_allclose(found.joints[:, here], poses.joints[:, there], atol=1e-6)
        np.testing.assert_allclose(found.covariance[:, here], poses.covariance[:, there], rtol=1e-5)
        np.testing.assert_allclose(found.confidence[:, here], poses.confidence[:, there], rtol=1e-5)
    # The rotations and the skeleton place the same points, wrists and spine, too.
    posed = poses.has_pose
    placed, tips = place_joints(found.skeleton, js.Pose(found.joints[posed, 0], found.rotations[posed]))
    np.testing.assert_allclose(placed, found.joints[posed], atol=1e-5)
    np.testing.assert_allclose(tips, found.tips[posed], atol=1e-5)
    assert np.isnan(found.joints[~posed]).all()


def test_the_human_template_changes_nothing_and_others_are_told():
    assert prepare(js.synthetic.make_scene(2), paper_settings(default_adult())).scale == 1
    with pytest.raises(ValueError, match="template: 'hand' has points that are not on the human body"):
        Settings(template=hand())
    other = replace(js.synthetic.make_scene(2), skeleton=hand())
    with pytest.raises(ValueError, match="its skeleton is of 'hand'; give that template in the settings"):
        reconstruct(other, paper_settings())


@pytest.mark.slow
@pytest.mark.parametrize(("name", "least"), [("quadruped", 0.95), ("hand", 0.95)])
def test_labels_and_poses_of_other_bodies(name, least):
    skeleton = built_in(name)
    scene, settings = scene_of(skeleton, 50, seed=7), paper_settings(skeleton)
    assert right_labels(scene, settings).mean() >= least
    poses = reconstruct(scene[:32], settings)
    assert poses.has_pose.all()
    assert poses.template == skeleton.template
    assert errors(poses, scene[:32])[0] < 0.03 * skeleton.size
    js.warm_up(scene.cameras, settings)
    stream = js.Stream(scene.cameras, settings, fps=25.0)
    streamed = [stream.push(scene.silhouettes[frame]) for frame in range(3)]
    assert all(each.has_pose.all() for each in streamed)
    # It finds the size in the first frame.
    assert np.median(np.abs(streamed[0].joints - poses.joints[:1])) < 0.05 * skeleton.size
    # A body of twice the size, seen from twice as far, has the same poses at twice the size.
    twice = replace(scene[:32], cameras=scene.cameras.scaled(2.0))
    again = reconstruct(twice, paper_settings(skeleton.scaled(2.0)))
    np.testing.assert_allclose(again.joints, 2 * poses.joints, atol=1e-2 * skeleton.size)
    np.testing.assert_allclose(again.skeleton.size, 2 * poses.skeleton.size, rtol=1e-4)
    assert again.covariance[again.has_pose].mean() == pytest.approx(
        4 * poses.covariance[poses.has_pose].mean(), rel=0.1
    )
