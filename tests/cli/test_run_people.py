"""`jaxskel run` of several people, and what is done with their poses, as its users run it."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from support.command_line import jaxskel

from jaxskel.io.poses import read_people_poses, read_poses
from jaxskel.io.recordings import read_people, write_people, write_recording
from jaxskel.io.subjects import write_subject
from jaxskel.people import everybody
from jaxskel.synthetic import draw_adult, make_people, stand_close

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two people who stand a metre apart: masks of each, and one for both."""
    folder = tmp_path_factory.mktemp("people")
    skeletons = [draw_adult(place).skeleton for place in (1, 2)]
    motions = stand_close(skeletons, 4, 4.0, gap=1.0)
    people = make_people({"anna": (skeletons[0], motions[0]), "ben": (skeletons[1], motions[1])}, 4.0)
    write_people(folder / "room.npz", {name: replace(one, skeleton=None) for name, one in people.items()})
    write_recording(folder / "blobs.npz", everybody(people))
    return folder


@pytest.fixture(scope="module")
def done(folder):
    return jaxskel("run", "room.npz", "-o", "out", "--preset", "paper", cwd=folder)


def test_poses_of_each_are_written_and_said(done, folder):
    assert done.returncode == 0, done.stderr
    *_, last = done.stdout.strip().splitlines()
    assert last == "out/poses.npz, out/poses_anna.csv, out/poses_ben.csv: 2 people: anna, ben"
    assert "anna: unknown subject: stature 1." in done.stdout
    assert re.search(r"^ben: 4 frames, 4 with a pose( \(\d view_lost\))?, 0 without, ", done.stdout, re.MULTILINE)
    assert list(read_people_poses(folder / "out" / "poses.npz")) == ["anna", "ben"]


def test_people_are_told_apart_in_one_mask_for_all(folder, done):
    found = jaxskel("run", "blobs.npz", "-o", "all", "--people", "all", "--preset", "paper", cwd=folder)
    assert found.returncode == 0, found.stderr
    assert "person_1" in found.stdout.splitlines()[-1]
    people, masks = (read_people_poses(folder / name / "poses.npz") for name in ("all", "out"))
    assert list(people) == ["person_1", "person_2"]
    # Who is alone in every pixel is found as with masks of one's own.
    for poses in people.values():
        away = min(np.nanmedian(np.linalg.norm(poses.joints - other.joints, axis=-1)) for other in masks.values())
        assert away < 0.03


def test_a_batch_has_a_result_for_each(done, folder):
    found = jaxskel("batch", "room.npz", "-o", "batch", "--preset", "paper", "--jobs", "1", cwd=folder)
    assert found.returncode == 0, found.stderr
    assert "batch: 2 recordings, 2 done (0 of them before); 8 frames" in found.stdout
    for name, poses in read_people_poses(folder / "out" / "poses.npz").items():
        np.testing.assert_array_equal(read_poses(folder / "batch" / "room" / name / "poses.npz").joints, poses.joints)
    again = jaxskel("batch", "room.npz", "-o", "batch", "--preset", "paper", "--jobs", "1", cwd=folder)
    assert "2 done (2 of them before)" in again.stdout
    write_subject(folder / "anna.toml", draw_adult(1).skeleton)
    refused = jaxskel("batch", "room.npz", "-o", "own", "--subject", folder / "anna.toml", cwd=folder)
    assert refused.returncode != 0
    assert "has several people, but --subject" in refused.stdout.replace("\n", " ")


def test_each_is_checked_and_what_is_wrong_with_all_is_said_before_any_work(folder):
    good = jaxskel("check", "room.npz", "-o", "check.png", cwd=folder)
    assert good.returncode == 0, good.stdout + good.stderr
    assert "anna: hull and silhouettes in 4 frames" in good.stdout
    assert good.stdout.splitlines()[-1].startswith("check.png: frame 2 of room.npz, ")
    people = read_people(folder / "room.npz")
    write_people(folder / "km.npz", {n: replace(one, cameras=one.cameras.scaled(1e-3)) for n, one in people.items()})
    bad = jaxskel("check", "km.npz", "-o", "bad.png", cwd=folder)
    assert bad.returncode == 2
    for name in people:
        assert f"{name}: wrong: what the silhouettes show is " in bad.stdout
    refused = jaxskel("run", "km.npz", "-o", "refused", "--preset", "paper", cwd=folder)
    assert refused.returncode == 2
    assert "km.npz: anna: what the silhouettes show is " in refused.stderr
    assert not (folder / "refused").exists()


def test_without_the_option_the_status_says_why(folder):
    found = jaxskel("run", "blobs.npz", "-o", "one", "--preset", "paper", cwd=folder)
    assert found.returncode == 1
    assert "4 several_people" in found.stdout
    assert "tell them apart by --people all" in found.stderr


def test_scores_and_files_of_each(done, folder):
    found = jaxskel("evaluate", "out/poses.npz", "room.npz", "-o", "score", cwd=folder)
    assert found.returncode == 0, found.stderr
    assert "0 identities exchanged, 0 people missed and 0 false of 8 in all frames: MOTA 100.0 %" in found.stdout
    figures = json.loads((folder / "score" / "score.json").read_text())
    assert {name: one["found_as"] for name, one in figures["people"].items()} == {"anna": "anna", "ben": "ben"}
    found = jaxskel("export", "out/poses.npz", "a.trc", "a.angles.csv", "angles.csv", cwd=folder)
    assert found.returncode == 0, found.stderr
    names = [line.partition(":")[0] for line in found.stdout.strip().splitlines()]
    assert names == [f"{start}{name}{end}" for name in ("anna", "ben")
                     for start, end in (("a_", ".trc"), ("a_", ".angles.csv"), ("", "_angles.csv"))]  # fmt: skip
    assert all((folder / name).exists() for name in names)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("blobs.npz", "--people", "9"), "--people 9: give a number from 1 to 8, or all"),
        (("blobs.npz", "--people", "two"), "--people two: give a number from 1 to 8, or all"),
        (("room.npz", "--people", "2"), "--people: is for masks that show everybody; room.npz has masks of each"),
        (("room.npz", "--subject", "anna.toml"), "has several people, but --subject anna.toml is one"),
        (("room.npz", "--smooth", "400"), "room.npz: a cutoff of 400 Hz; give one between 0 and"),
        (("room.npz", "--data", "data.npz"), "--data: is of one person, but there are several"),
    ],
)
def test_what_makes_no_sense_is_refused(arguments, message, folder):
    found = jaxskel("run", *arguments, "-o", "refused", cwd=folder)
    assert found.returncode == 2
    assert message in found.stderr
    assert not (folder / "refused").exists()
