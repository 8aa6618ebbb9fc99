"""Marker files and animations of other skeletons than the paper's human, read by other programs' readers."""

import csv

import numpy as np
import pybvh
import pytest
import trc
from support.poses import moving, points
from support.templates import acting, animal, hand

from jaxskel.body import BODY_25, HUMAN_15
from jaxskel.io.poses import (
    read_trc,
    with_up,
    write_angles,
    write_bvh,
    write_c3d,
    write_keypoint_table,
    write_mot,
    write_trc,
    write_trc_deviations,
)
from jaxskel.io.poses._rig import rig_rows
from jaxskel.poses import joint_angles

TENTH_OF_MM = 1e-4
OTHERS = pytest.mark.parametrize("skeleton", [hand(), animal()], ids=["hand", "animal"])


@OTHERS
def test_another_reader_finds_the_markers(tmp_path, skeleton):
    poses, names = acting(skeleton, without=(5,)), skeleton.template.point_names
    data = trc.TRCData()
    data.load(str(write_trc(tmp_path / "poses.trc", poses)))
    assert data["Markers"] == list(names)
    found = np.stack([np.array(data[name]) for name in names], 1)
    np.testing.assert_allclose(found, points(poses, "+Y"), atol=TENTH_OF_MM)
    deviations = read_trc(write_trc_deviations(tmp_path / "poses.sigma.trc", poses))
    assert deviations.names == skeleton.template.joint_names


@OTHERS
def test_another_reader_finds_the_points_of_a_c3d(tmp_path, skeleton):
    ezc3d = pytest.importorskip("ezc3d")
    poses = acting(skeleton, without=(5,))
    file = ezc3d.c3d(str(write_c3d(tmp_path / "poses.c3d", poses)))
    assert file["parameters"]["POINT"]["LABELS"]["value"] == list(skeleton.template.point_names)
    found = file["data"]["points"][:3].transpose(2, 1, 0) / 1000
    np.testing.assert_allclose(found, points(poses, "+Z"), atol=TENTH_OF_MM)


@OTHERS
def test_the_animation_moves_as_the_poses_do(tmp_path, skeleton):
    poses, template = acting(skeleton, up="+Y"), skeleton.template
    written = write_bvh(tmp_path / "poses.bvh", poses)
    assert written.deviation < TENTH_OF_MM
    animation = pybvh.Bvh.from_file(str(written.path))
    parents = {point: parent for _, parent, point, _ in rig_rows(template)}
    ends = {tip: f"EndSite{parents[tip]}" for tip in template.tip_names}
    nodes = [animation.node_index[ends.get(name, name)] for name in template.point_names]
    found = animation.node_positions()[:, nodes] * 0.01
    np.testing.assert_allclose(found, points(with_up(poses, "+Y"), "+Y"), atol=TENTH_OF_MM)
    assert animation.frame_time == pytest.approx(1 / poses.fps)


def test_rows_of_an_animal():
    rows = {name: (parent, segment) for name, parent, _, segment in rig_rows(animal().template)}
    # The pelvis holds the hips and the chest the forelegs and the neck, each with its own rotation.
    assert rows["pelvis"] == ("", "pelvis")
    assert rows["pelvis_trunk"] == ("pelvis", "trunk")
    assert rows["chest"] == ("pelvis_trunk", "trunk")
    assert rows["l_hip"] == ("pelvis", "l_thigh")
    assert rows["chest_l_foreleg"] == ("chest", "l_foreleg")
    assert rows["l_elbow"] == ("chest_l_foreleg", "l_forepaw")
    # The head turns inside its bone.
    assert rows["atlas"] == ("chest_neck", "head")
    assert rows["head"] == ("atlas", "head")


def test_angles_are_flexions_of_the_hinges(tmp_path):
    poses = acting(hand(), without=(2,))
    found = joint_angles(poses)
    assert found.names == ("index_middle_flexion", "little_middle_flexion")
    assert np.isnan(found.values[2]).all()
    # By hand: the angle between the two bones, signed by whether the outer one goes to the palm's side.
    finger = poses.joints[0, 3] - poses.joints[0, 2], poses.tips[0, 0] - poses.joints[0, 3]
    upper, lower = (bone.astype(float) / np.linalg.norm(bone) for bone in finger)
    axis = poses.rotations[0, 2] @ [0, 1, 0]
    flat = lower - (lower @ axis) * axis
    angle = np.arctan2(np.cross(upper, flat) @ axis, upper @ flat)
    assert found.values[0, 0] == pytest.approx(angle, abs=1e-4)
    with open(write_angles(tmp_path / "angles.csv", poses), newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[3:] == ["index_middle_flexion_deg", "little_middle_flexion_deg"]
    assert float(rows[0]["index_middle_flexion_deg"]) == pytest.approx(np.rad2deg(angle), abs=0.01)
    lines = write_mot(tmp_path / "hand.mot", poses).read_text().splitlines()
    assert lines[6].split("\t") == ["time", "index_middle_flexion", "little_middle_flexion"]
    assert len(lines) == 7 + 23
    with pytest.raises(ValueError, match="animal has no hinges"):
        joint_angles(acting(animal()))


def test_keypoints_are_the_points_that_they_mean(tmp_path):
    poses = moving(12, without=(3,))
    found = dict(zip(BODY_25.names, poses.keypoints(BODY_25).swapaxes(0, 1), strict=True))
    shoulders = [poses.joints[:, HUMAN_15.joint_names.index(f"{side}_shoulder")] for side in "lr"]
    np.testing.assert_allclose(found["Neck"], (shoulders[0] + shoulders[1]) / 2, atol=1e-6)
    assert np.isnan(found["Nose"]).all()
    assert np.isnan(found["LWrist"][3]).all()
    # The wrist is on the way from elbow to palm, which is as long as it is at rest.
    elbow, palm = (poses.joints[:, HUMAN_15.joint_names.index(f"l_{name}")] for name in ("elbow", "hand"))
    rest = poses.skeleton.rest_joints
    forearm = 0.71 * np.linalg.norm(rest[5] - rest[4])
    for start, length in ((elbow, forearm), (palm, forearm * 0.29 / 0.71)):
        lengths = np.linalg.norm(found["LWrist"] - start, axis=-1)
        np.testing.assert_allclose(lengths[poses.has_pose], length, atol=1e-5)
    markers = read_trc(write_trc(tmp_path / "body.trc", poses, keypoint_set=BODY_25))
    assert "Nose" not in markers.names
    np.testing.assert_allclose(
        markers.positions[:, markers.names.index("LWrist")], found["LWrist"][:, [1, 2, 0]], atol=TENTH_OF_MM
    )
    with open(write_keypoint_table(tmp_path / "body.csv", poses, BODY_25), newline="") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[1]["RKnee_z"]) == pytest.approx(found["RKnee"][1, 2], abs=1e-6)
    assert rows[3]["RKnee_z"] == ""
    with pytest.raises(ValueError, match="three-fingered hand has no keypoints"):
        acting(hand()).keypoints(BODY_25)
