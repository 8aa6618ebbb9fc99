"""Poses of any template are scored against truth of any other, by the names of the joints that both have."""

from dataclasses import replace

import numpy as np
import pytest
from support.poses import moving
from support.templates import acting, animal, hand

from jaxskel.body import HUMAN_15, JOINT_NAMES
from jaxskel.poses import LIMBS, score, score_poses, score_table
from jaxskel.poses.metrics import join_scores
from jaxskel.visualization.plots import plot_score


def test_poses_of_the_human_are_scored_as_their_joints_are():
    poses, noise = moving(20, without=(4,)), np.random.default_rng(2)
    truth = moving(20).joints + noise.normal(0, 0.08, (20, 15, 3))
    truth[:5] = truth[:5][:, np.asarray(HUMAN_15.mirror_joints)]
    whole = score_poses(poses, truth)
    assert whole.to_dict() == score(poses.joints, truth, poses.has_pose).to_dict()
    assert whole.limbs == LIMBS
    assert whole.left_out == ()
    assert "joints_left_out" not in whole.to_dict()


def test_only_joints_of_the_same_name_are_compared():
    poses, human = acting(animal()), moving(24)
    names = poses.template.joint_names
    truth = human.joints.astype(np.float64) * np.nan
    both = ["pelvis", "head", "l_elbow", "r_elbow", "l_hip", "l_knee", "r_hip", "r_knee"]
    for name in both:
        truth[:, JOINT_NAMES.index(name)] = poses.joints[:, names.index(name)]
    truth[:, JOINT_NAMES.index("head")] += [0.0, 0.0, 0.2]
    found = score_poses(poses, truth, HUMAN_15)
    assert list(found.joint_names) == [name for name in names if name in both]
    assert found.limbs == ("head",)
    assert found.wrong("head") == 24
    assert found.wrong("l_knee") == 0
    assert found.left_out[:2] == ("chest", "neck")
    assert found.to_dict()["joints_left_out"] == list(found.left_out)
    assert list(found.to_dict()["sides_counted"]["wrong"]) == ["head"]


def test_exchanged_limbs_of_another_template_are_forgiven(tmp_path):
    poses = acting(animal())
    mirror = np.asarray(poses.template.mirror_joints)
    swapped = poses.joints[:, mirror].astype(np.float64)
    found = score_poses(poses, swapped, poses.template)
    assert not found.forgiven.any()
    assert found.wrong("l_knee") + found.wrong("l_elbow") > 0
    # The truth knows no knees: hips are exchanged all the same, as the ends of what is left of the legs.
    some = replace(
        poses.template, joint_names=tuple(name.replace("knee", "stifle") for name in poses.template.joint_names)
    )
    found = score_poses(poses, swapped, some)
    assert set(found.left_out) == {"l_knee", "r_knee", "l_stifle", "r_stifle"}
    assert not found.forgiven.any()
    table = score_table({"animal": found})
    assert "l_stifle" in str(table.caption)
    assert "all 7\nright" in [str(column.header) for column in table.columns]
    plot_score(found, tmp_path / "score.png")


def test_scores_of_a_template_without_sides_and_limbs():
    poses = acting(hand())
    found = score_poses(poses, poses.joints + 0.1, poses.template, threshold=0.01)
    assert found.limbs == ()
    np.testing.assert_array_equal(found.forgiven, found.distances)
    assert found.all_correct() == 0.0
    assert found.to_dict()["sides_counted"]["wrong"] == {}


def test_what_has_no_name_in_common_is_refused():
    with pytest.raises(ValueError, match=r"no joint of the poses \(wrist, thumb, .* has the name of one of the truth"):
        score_poses(acting(hand()), moving(24).joints)


def test_joints_of_another_template_are_refused():
    joints = acting(hand()).joints
    with pytest.raises(ValueError, match="6 and 6 joints, but human-15 has 15; give its template"):
        score(joints, joints)


def test_scores_of_different_joints_are_not_joined():
    one, other = acting(hand()), acting(animal())
    scores = [score_poses(each, each.joints, each.template) for each in (one, other)]
    with pytest.raises(ValueError, match="different joints"):
        join_scores(scores)
