"""Poses are scored against markers of other programs, by what their names mean."""

import numpy as np
import pytest
from support.poses import moving

from jaxskel.body import BODY_25, COCO_17, JOINT_NAMES
from jaxskel.poses import score_markers, score_poses

POSES = moving(20, without=(4,))


def markers_of(keypoint_set, poses):
    """Keypoints of poses, in another order, with a stranger among them."""
    names = ("Clavicle", *reversed(keypoint_set.names))
    places = poses.keypoints(keypoint_set)[:, ::-1]
    known = np.isfinite(places).any((0, 2))
    kept = tuple(name for name, there in zip(names[1:], known, strict=True) if there)
    return np.concatenate([np.zeros((len(poses), 1, 3)), places[:, known]], 1), (names[0], *kept)


@pytest.mark.parametrize("keypoint_set", [BODY_25, COCO_17])
def test_keypoints_are_compared_by_their_meaning(keypoint_set):
    positions, names = markers_of(keypoint_set, moving(20))
    positions[:, names.index("LWrist")] += [0.0, 0.15, 0.0]
    positions[7, names.index("RKnee")] = np.nan
    found = score_markers(POSES, positions, names, keypoint_set)
    assert found.without_truth == 1
    assert found.left_out == ("Clavicle",)
    assert set(found.joint_names) == set(names[1:])
    assert found.wrong("LWrist") == 19
    assert found.wrong("RWrist") == 1  # in the frame without a pose
    assert found.percentile(50, "LWrist") == pytest.approx(0.15, abs=1e-6)
    assert found.percentile(95, "RElbow") == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("keypoint_set", [BODY_25, COCO_17])
def test_exchanged_arms_and_legs_are_forgiven(keypoint_set):
    positions, names = markers_of(keypoint_set, POSES)
    turned = [names.index({"L": "R", "R": "L"}.get(name[0], name[0]) + name[1:]) for name in names]
    found = score_markers(POSES, positions[:, turned], names, keypoint_set)
    assert found.wrong("LAnkle") == len(found)
    assert found.wrong("LAnkle", forgive_swaps=True) == 0
    assert found.forgiven.max() < 1e-6


def test_markers_that_are_joints_are_scored_as_joints():
    truth = moving(20).joints + np.random.default_rng(3).normal(0, 0.08, (20, 15, 3))
    truth[:6] = truth[:6, [JOINT_NAMES.index(name.replace("l_", "x_").replace("r_", "l_").replace("x_", "r_"))
                           for name in JOINT_NAMES]]  # fmt: skip
    order = np.random.default_rng(4).permutation(15)
    names = tuple(JOINT_NAMES[place] for place in order)
    assert score_markers(POSES, truth[:, order], names).to_dict() == score_poses(POSES, truth).to_dict()


def test_markers_of_unknown_names_are_refused_in_one_line():
    with pytest.raises(ValueError, match="no marker .Clavicle. has the name of one of .*; give the set") as refused:
        score_markers(POSES, np.zeros((20, 1, 3)), ("Clavicle",))
    assert "\n" not in str(refused.value)
