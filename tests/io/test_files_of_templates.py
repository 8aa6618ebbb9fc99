"""Poses and truth of other skeletons than the paper's human, in the package's own files."""

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.files import arrays_of, refused, same
from support.poses import moving
from support.templates import ANIMAL, HAND, acting, animal, hand

from jaxskel import Truth
from jaxskel.io.poses import JOURNAL_FILE, PosesJournal, read_poses, read_truth, write_poses
from jaxskel.io.recordings import read_recording, write_recording
from jaxskel.synthetic import camera_ring, make_scene


def changed(path: Path, **values: Any) -> None:
    """Write a file again with other values of some keys."""
    arrays: dict[str, Any] = arrays_of(path) | values
    np.savez(path, **arrays)


@pytest.mark.parametrize("skeleton", [hand(), animal()], ids=["hand", "animal"])
def test_poses_come_back_with_their_template(tmp_path, skeleton):
    poses = acting(skeleton, without=(3,))
    archive, table = write_poses(tmp_path, poses)
    found = read_poses(archive)
    assert found.template == skeleton.template
    assert same(found, poses)
    older = replace(poses, rotations=None, skeleton=None)
    assert same(read_poses(write_poses(tmp_path / "older", older)[0]), older)
    with open(table, newline="") as file:
        rows = list(csv.DictReader(file))
    for i, joint in enumerate(skeleton.template.joint_names):
        assert float(rows[2][f"{joint}_y"]) == pytest.approx(poses.joints[2, i, 1], abs=1e-6)
        assert rows[3][f"{joint}_sigma_mm"] == ""


def test_a_file_of_the_human_says_nothing_of_its_template(tmp_path):
    archive, _ = write_poses(tmp_path, moving(3))
    assert "template" not in arrays_of(archive)
    assert list(arrays_of(archive))[6:9] == ["joint_names", "joint_parents", "tip_names"]


@pytest.mark.parametrize("text", ["", "{}", "[1, 2]", HAND.text[:-5], HAND.text.replace("[3,3,6,", "[3,")])
def test_a_wrong_template_names_file_and_key(tmp_path, text):
    archive, _ = write_poses(tmp_path, acting(hand()))
    changed(archive, template=text)
    refused(read_poses, archive, "key 'template': ", "describes no template")


def test_names_must_be_those_of_the_template(tmp_path):
    archive, _ = write_poses(tmp_path, acting(hand()))
    changed(archive, template=ANIMAL.text)
    refused(read_poses, archive, "key 'joint_names': ", "reorder the file to pelvis, chest")


def test_a_journal_knows_its_template(tmp_path):
    poses = acting(animal(), without=(0,))
    journal = PosesJournal(tmp_path / JOURNAL_FILE, poses.fps, poses.up, poses.template)
    journal.append(poses)
    journal.close()
    assert same(read_poses(journal.path), read_poses(write_poses(tmp_path, poses)[0]))


def test_truth_of_another_template_comes_back(tmp_path):
    poses = acting(hand(), 2)
    scene = make_scene(2, cameras=camera_ring(3, size=(64, 48)))
    recording = replace(scene, skeleton=hand(), truth=Truth(poses.joints, poses.tips, HAND))
    write_recording(tmp_path / "hand.npz", recording)
    found = read_recording(tmp_path / "hand.npz")
    assert found.skeleton is not None
    assert found.truth is not None
    assert found.skeleton.template == found.truth.template == HAND
    np.testing.assert_array_equal(found.truth.joints, poses.joints)
    assert same(found.truth[1:], Truth(found.truth.joints[1:], poses.tips[1:].astype(np.float64), HAND))
    truth, _, _ = read_truth(tmp_path / "hand.npz")
    assert truth.template == HAND
    with pytest.raises(ValueError, match="human-15 and three-fingered hand; a file holds one"):
        write_recording(tmp_path / "two.npz", replace(recording, skeleton=scene.skeleton))


def test_points_in_millimetres_are_refused_for_any_template(tmp_path):
    archive, _ = write_poses(tmp_path, acting(animal()))
    changed(archive, joints=1000 * arrays_of(archive)["joints"])
    refused(read_truth, archive, "key 'joints': ", "lengths are metres")


def test_points_of_another_template_are_refused():
    poses = acting(hand(), 2)
    with pytest.raises(ValueError, match="is human-15, but that of the skeleton is three-fingered hand"):
        replace(poses, template=moving(1).template)
    with pytest.raises(ValueError, match="are 6 and 3, but the template animal has 9 and 5"):
        replace(poses, skeleton=None, template=ANIMAL)
    with pytest.raises(ValueError, match="joints: are 6, but the template human-15 has 15"):
        Truth(poses.joints)
