"""Several people on disk: folders with instance masks, sequence files, and poses with an axis of people."""

import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.phantoms import chain, film
from support.poses import moving
from support.recording_folders import SIZE, a_recording

from jaxskel import Truth, read_recording, unpack_silhouettes
from jaxskel.io.calibrations import write_pose2sim_calibration
from jaxskel.io.poses import (
    read_people_poses,
    read_people_truth,
    read_poses,
    write_archive,
    write_people_archive,
    write_people_poses,
    write_poses,
)
from jaxskel.io.recordings import holds_people, input_paths, read_people, write_people, write_recording


@pytest.fixture(scope="module")
def people():
    """Anna walks; Ben stands farther left, and is not seen in the last view."""
    anna = a_recording().named("anna")
    bodies = [chain([-0.6, -0.5, 0.4], [-0.6, -0.5, 1.3], 0.2)] * len(anna)
    masks = film(anna.cameras, bodies) & ~np.asarray(anna.silhouettes)
    masks[:, 2] = 0
    return {"anna": anna, "ben": replace(anna, silhouettes=masks, name="ben")}


def written(folder, people, masks, people_lines):
    """A folder whose views have the masks that the line `masks` names."""
    cameras = next(iter(people.values())).cameras
    write_pose2sim_calibration(folder / "Calib.toml", cameras)
    lines = ["fps = 25.0", 'calibration = "Calib.toml"', 'up = "+Z"', *people_lines]
    for name in cameras.names:
        lines += [f"[views.{name}]", masks.format(view=name, person="{person}")]
    (folder / "recording.toml").write_text("\n".join(lines) + "\n")
    return folder


def images(folder, view, masks):
    (folder / view).mkdir(parents=True)
    for frame, mask in enumerate(masks):
        assert cv2.imwrite(str(folder / view / f"{frame:06d}.png"), mask)


@pytest.fixture(scope="module")
def labelled(tmp_path_factory, people):
    """One image for all: 3 is Anna and 7 is Ben."""
    folder = tmp_path_factory.mktemp("labels")
    for view, name in enumerate(people["anna"].cameras.names):
        anna, ben = (unpack_silhouettes(one.silhouettes[:, view], SIZE[0]) for one in people.values())
        images(folder / "masks", name, np.where(anna, 3, np.where(ben, 7, 0)).astype(np.uint8))
    lines = ["[people.anna]", "person = [3]", "[people.ben]", "person = [7]"]
    return written(folder, people, 'masks = "masks/{view}"', lines)


@pytest.fixture(scope="module")
def apart(tmp_path_factory, people):
    """A folder of masks for each person and view."""
    folder = tmp_path_factory.mktemp("folders")
    for person, recording in people.items():
        for view, name in enumerate(recording.cameras.names):
            images(folder / person, name, 255 * unpack_silhouettes(recording.silhouettes[:, view], SIZE[0]))
    return written(folder, people, 'masks = "{person}/{view}"', ["[people.anna]", "[people.ben]"])


@pytest.mark.parametrize("kind", ["labelled", "apart", "file"])
def test_each_person_is_read_by_name(kind, labelled, apart, people, tmp_path):
    write_people(tmp_path / "room.npz", people)
    path = {"labelled": labelled, "apart": apart, "file": tmp_path / "room.npz"}[kind]
    assert holds_people(path)
    found = read_people(path)
    assert list(found) == ["anna", "ben"]
    for name, recording in found.items():
        assert recording.name == name
        np.testing.assert_array_equal(recording.silhouettes[:], people[name].silhouettes)
        assert recording.cameras.names == people[name].cameras.names
    with pytest.raises(ValueError, match="read them with read_people|are several; read them with read_people"):
        read_recording(path)


def test_the_files_that_are_read_are_listed(labelled, apart):
    assert {"masks/left", "masks/front", "masks/right", "Calib.toml"} <= set(input_paths(labelled))
    assert {"anna/left", "ben/right", "Calib.toml"} <= set(input_paths(apart))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("person = [7]", "persn = [7]", "people.ben.persn'"),
        ("person = [7]", "", "people.ben.person': give either the values of the masks that are ben"),
        ("[people.ben]", '[people."a b"]', "people.a b': is no name; give letters, digits, _ and -"),
        ('masks = "masks/left"', 'masks = "masks/left"\nperson = [3]', "views.left.person': belongs to one person"),
        ('masks = "masks/left"', 'images = "masks/left"', "views.left.masks': is missing; people are told apart by"),
        ('masks = "masks/left"', 'masks = "{person}/left"', "people.anna.person': give either"),
        ("person = [7]", "person = [0.5]", "people.ben.person': is .* give values of the masks"),
        ("[people.ben]", "[others]", "others': is not known"),
    ],
)
def test_faults_name_the_key(old, new, message, labelled, tmp_path):
    text = (labelled / "recording.toml").read_text()
    assert old in text
    shutil.copytree(labelled, tmp_path, dirs_exist_ok=True)
    (tmp_path / "recording.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(ValueError, match=message):
        read_people(tmp_path)


def test_what_is_of_one_person_is_said_to_be(people, tmp_path):
    write_recording(tmp_path / "one.npz", people["anna"])
    assert not holds_people(tmp_path / "one.npz")
    assert not holds_people(tmp_path / "nothing.npz")
    with pytest.raises(ValueError, match=r"one.npz: key 'silhouettes': are of one person, or of all"):
        read_people(tmp_path / "one.npz")


def test_what_others_hide_is_kept_in_a_sequence_file(people, tmp_path):
    hidden = people["ben"].silhouettes
    write_recording(tmp_path / "one.npz", replace(people["anna"], hidden=hidden))
    np.testing.assert_array_equal(read_recording(tmp_path / "one.npz").hidden, hidden)
    assert read_recording(tmp_path / "one.npz")[2:4].hidden.shape[0] == 2


def posed():
    """Anna and Ben, who has no pose in two frames and whose stature was given."""
    return {"anna": replace(moving(5), stature_deviation=0.02), "ben": moving(5, without=(0, 3))}


def same(one, other):
    for key in ("joints", "tips", "rotations", "confidence", "side_confidence", "status", "covariance", "frame_index"):
        np.testing.assert_array_equal(getattr(one, key), getattr(other, key), err_msg=key)
    np.testing.assert_allclose(one.skeleton.rest_joints, other.skeleton.rest_joints)
    assert (one.fps, one.up, one.stature_deviation) == (other.fps, other.up, other.stature_deviation)


def test_poses_of_people_come_back(tmp_path):
    archive, *tables = write_people_poses(tmp_path, posed())
    assert [table.name for table in tables] == ["poses_anna.csv", "poses_ben.csv"]
    found = read_people_poses(archive)
    assert list(found) == ["anna", "ben"]
    for name, poses in posed().items():
        same(found[name], poses)
        write_poses(tmp_path / name, poses)
        assert (tmp_path / name / "poses.csv").read_bytes() == (tmp_path / f"poses_{name}.csv").read_bytes()
    with np.load(archive) as arrays:
        assert arrays["people"].tolist() == ["anna", "ben"]
        assert arrays["joints"].shape == (2, 5, 15, 3)
    with pytest.raises(ValueError, match="'people': holds several people: anna, ben; read them with read_people_poses"):
        read_poses(archive)


def test_what_only_some_have_is_missing_for_the_others(tmp_path):
    bare = replace(posed()["ben"], covariance=None, rotations=None, skeleton=None)
    people = {"anna": posed()["anna"], "ben": bare, "nobody": moving(5, without=(0, 1, 2, 3, 4))}
    found = read_people_poses(write_people_archive(tmp_path / "a.npz", people))
    same(found["anna"], people["anna"])
    assert (found["ben"].covariance, found["ben"].rotations, found["ben"].skeleton) == (None, None, None)
    np.testing.assert_array_equal(found["ben"].joints, bare.joints)
    same(found["nobody"], people["nobody"])


def test_somebody_alone_is_written_as_ever(tmp_path):
    archive, table = write_people_poses(tmp_path, {"anna": posed()["anna"]})
    assert archive.read_bytes() == write_archive(tmp_path / "one.npz", posed()["anna"]).read_bytes()
    assert table.name == "poses.csv"
    same(read_people_poses(archive)["person"], posed()["anna"])


def test_people_of_different_frames_or_damaged_files_are_refused(tmp_path):
    with pytest.raises(ValueError, match="ben has other frames or another template"):
        write_people_archive(tmp_path / "a.npz", {"anna": moving(5), "ben": moving(4)})
    with pytest.raises(ValueError, match="there is nobody to write"):
        write_people_archive(tmp_path / "a.npz", {})
    with np.load(write_people_archive(tmp_path / "a.npz", posed())) as arrays:
        whole = dict(arrays)
    for key, value, message in (
        ("joints", whole["joints"][:1], "'joints': has shape .* give one row for each of 2 people"),
        ("people", ["anna", "anna"], "'people': is .* give different names"),
        ("status", whole["status"] + 90, "'status': give 5 whole numbers"),
    ):
        np.savez(tmp_path / "b.npz", **(whole | {key: value}))
        with pytest.raises(ValueError, match=message):
            read_people_poses(tmp_path / "b.npz")


def test_truth_of_people(people, tmp_path):
    joints = {name: moving(len(one)).joints.astype(float) + shift for shift, (name, one) in enumerate(people.items())}
    known = {name: replace(one, truth=Truth(joints[name])) for name, one in people.items()}
    write_people(tmp_path / "room.npz", known)
    write_people_archive(tmp_path / "poses.npz", posed())
    for path, wanted in (
        (tmp_path / "room.npz", joints), (tmp_path / "poses.npz", {n: p.joints for n, p in posed().items()}),
    ):  # fmt: skip
        found = read_people_truth(path)
        for name, (truth, up, index) in found.items():
            np.testing.assert_allclose(truth.joints, wanted[name])
            assert up == "+Z"
            assert len(index) == len(truth.joints)


def test_names_in_a_sequence_file_that_are_no_names_of_files_are_refused(tmp_path, people):
    write_people(tmp_path / "room.npz", {"../../anna": people["anna"], "ben": people["ben"]})
    with pytest.raises(ValueError, match=r"room\.npz: key 'silhouettes_\.\./\.\./anna': is no name"):
        read_people(tmp_path / "room.npz")


@pytest.mark.parametrize("name", ["../anna", "a/b", "a\\b", "..", ""])
def test_names_in_poses_that_are_no_names_of_files_are_refused(tmp_path, name):
    write_people_archive(tmp_path / "poses.npz", {name: moving(), "ben": moving()})
    with pytest.raises(ValueError, match=r"poses\.npz: key 'people': has .*, which is no name of a file"):
        read_people_poses(tmp_path / "poses.npz")
