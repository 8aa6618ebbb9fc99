"""Poses in files: nothing is lost, and what is wrong is named."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from support.files import arrays_of, cut, refused, rows, same, scaled, some_poses

from jaxskel.body import JOINT_NAMES, SEGMENT_PARENTS, place_joints
from jaxskel.io.poses import read_poses, read_truth, with_up, write_poses
from jaxskel.poses import STATUS_NAMES, Status, join_poses


@pytest.fixture
def poses_file(tmp_path):
    return write_poses(tmp_path, some_poses())[0]


def test_poses_round_trip(poses_file):
    assert same(read_poses(poses_file), some_poses())


def test_poses_file_holds_what_its_readers_need(poses_file):
    arrays = arrays_of(poses_file)
    assert arrays["joint_names"].tolist() == list(JOINT_NAMES)
    assert arrays["status_names"].tolist() == list(STATUS_NAMES)
    assert arrays["joints"].dtype == np.float32
    assert arrays["confidence"].dtype == np.float32
    assert np.isnan(arrays["joints"][1]).all()


def test_what_an_older_version_wrote_has_no_rotations_and_covariances(tmp_path, poses_file):
    arrays = arrays_of(poses_file)
    for key in ("rotations", "segment_names", "rest_joints", "rest_tips", "sigma", "stature_sigma"):
        del arrays[key]
    np.savez(poses_file, **arrays)
    found = read_poses(poses_file)
    assert same(found, replace(some_poses(), rotations=None, skeleton=None, covariance=None, stature_deviation=None))
    # It is written, turned and put together as it is.
    again, _ = write_poses(tmp_path / "again", with_up(found, "+Y"))
    assert set(arrays_of(again)) == set(arrays)
    assert same(read_poses(again), found)
    assert join_poses([found, some_poses()]).rotations is None
    assert join_poses([found, some_poses()]).covariance is None
    assert found.deviations is None
    for what in ("pose", "local_rotations"):
        with pytest.raises(ValueError, match="an older version wrote them; reconstruct again"):
            getattr(found, what)


def test_rotations_lead_from_the_template_to_the_joints(poses_file):
    found = read_poses(poses_file)
    joints, tips = place_joints(found.skeleton, found.pose)
    np.testing.assert_allclose(found.joints, joints, atol=2e-6)
    np.testing.assert_allclose(found.tips, tips, atol=2e-6)
    # From the pelvis outwards, relative rotations lead to the same ones.
    turns = list(found.local_rotations.swapaxes(0, 1))
    for segment, parent in enumerate(SEGMENT_PARENTS):
        turns[segment] = turns[segment] if parent < 0 else turns[parent] @ turns[segment]
    np.testing.assert_allclose(np.stack(turns, 1), found.rotations, atol=2e-6)


def test_poses_table(tmp_path):
    poses = some_poses()
    _, table = write_poses(tmp_path / "new" / "folder", poses)
    with open(table, newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[:6] == ["frame_index", "time_s", "status", "pelvis_x", "pelvis_y", "pelvis_z"]
    assert list(rows[0])[-16:-14] == ["r_foot_confidence", "pelvis_sigma_mm"]
    assert [row["frame_index"] for row in rows] == ["7", "8", "9"]
    assert [float(row["time_s"]) for row in rows] == [0.0, 0.08, 0.16]
    assert [row["status"] for row in rows] == ["ok", "no_hull", "view_lost"]
    for name, cell in rows[1].items():
        assert (cell == "") == (name not in ("frame_index", "time_s", "status"))
    for i in (0, 2):
        for j, joint in enumerate(JOINT_NAMES):
            read = [float(rows[i][f"{joint}_{axis}"]) for axis in "xyz"]
            np.testing.assert_allclose(read, poses.joints[i, j], atol=1e-6)
            np.testing.assert_allclose(float(rows[i][f"{joint}_confidence"]), poses.confidence[i, j], atol=1e-4)
            # Deviations of 10, 20 and 30 mm.
            np.testing.assert_allclose(float(rows[i][f"{joint}_sigma_mm"]), (1400 / 3) ** 0.5, atol=0.05)


def test_poses_serve_as_truth(poses_file):
    truth, up, frame_index = read_truth(poses_file)
    assert np.array_equal(truth.joints, some_poses().joints, equal_nan=True)
    assert up == "+Y"
    assert frame_index.tolist() == [7, 8, 9]


WRONG_POSES = {
    "fewer tips": (cut("tips", 2), "tips", "give (3, 5, 3)"),
    "fewer confidences": (cut("confidence", 2), "confidence", "give (3, 15)"),
    "confidence in percent": (lambda a: {"confidence": np.full((3, 15), 90.0)}, "confidence", "0..1"),
    "negative side confidence": (rows("side_confidence", 0, -0.5), "side_confidence", "0..1"),
    "NaN confidence": (rows("confidence", (1, 4), np.nan), "confidence", "index (1, 4)"),
    "unknown status": (rows("status", 0, 99), "status", "view_lost"),
    "negative status": (rows("status", 0, -1), "status", "view_lost"),
    "status of floats": (scaled("status", 1.0), "status", "whole numbers"),
    "status without pose but joints": (rows("status", 2, Status.EMPTY), "joints", "frame 2 is empty"),
    "status with pose but no joints": (rows("status", 1, Status.OK), "joints", "frame 1 is ok"),
    "half a pose": (rows("tips", (0, 3), np.nan), "tips", "frame 0 is ok"),
    "fewer rotations": (cut("rotations", 2), "rotations", "give (3, 17, 3, 3)"),
    "half a rotation": (rows("rotations", (0, 3, 1), np.nan), "rotations", "frame 0 is ok"),
    "rotation without a pose": (rows("rotations", (1, 2, 1, 1), 1.0), "rotations", "frame 1 is no_hull"),
    "mirrored rotation": (lambda a: {"rotations": -a["rotations"]}, "rotations", "frame 0, pelvis: no rotation"),
    "scaled rotation": (rows("rotations", (2, 1), 2 * np.eye(3)), "rotations", "frame 2, chest: no rotation"),
    "sigma without a pose": (rows("sigma", (1, 2, 1, 1), 1.0), "sigma", "frame 1 is no_hull"),
    "negative sigma": (lambda a: {"sigma": -a["sigma"]}, "sigma", "frame 0, pelvis: no covariance"),
    "negative deviation": (lambda a: {"stature_sigma": np.array(-0.1)}, "stature_sigma", "not below zero"),
    "infinite rotation": (rows("rotations", (0, 0, 0, 0), np.inf), "rotations", "index (0, 0, 0, 0)"),
    "other segments": (lambda a: {"segment_names": a["segment_names"][::-1]}, "segment_names", "pelvis, chest"),
    "skeleton in millimetres": (scaled("rest_joints", 1000), "rest_joints", "give metres"),
    "fewer tips at rest": (cut("rest_tips", 2), "rest_tips", "give (5, 3)"),
    "other statuses": (lambda a: {"status_names": a["status_names"][::-1]}, "status_names", "ok, view_lost"),
    "fps": (lambda a: {"fps": np.array(0)}, "fps", "positive"),
    "up": (lambda a: {"up": np.array("up")}, "up", "+Z"),
    "frame_index": (cut("frame_index", 1), "frame_index", "3 whole numbers"),
}


@pytest.mark.parametrize("what", WRONG_POSES)
def test_wrong_poses_name_file_key_and_remedy(poses_file, what):
    change, key, remedy = WRONG_POSES[what]
    arrays = arrays_of(poses_file)
    np.savez(poses_file, **(arrays | change(arrays)))
    refused(read_poses, poses_file, f"key '{key}': ", remedy)


@pytest.mark.parametrize("key", ["rotations", "rest_joints", "rest_tips"])
def test_rotations_without_their_template_are_refused(poses_file, key):
    arrays = arrays_of(poses_file)
    del arrays[key]
    np.savez(poses_file, **arrays)
    refused(read_poses, poses_file, f"key '{key}': ", "is missing; give all of rotations, rest_joints, rest_tips")
