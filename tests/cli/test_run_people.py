"""`jaxskel run` of several people, and what is done with their poses, as its users run it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from support.command_line import jaxskel

from jaxskel.io.poses import read_people_poses
from jaxskel.io.recordings import write_people, write_recording
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
    assert "ben: 4 frames, 4 with a pose, 0 without" in done.stdout
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
        (("room.npz", "--subject", "anna.toml"), "anna.toml: is one person, but there are several"),
        (("room.npz", "--data", "data.npz"), "--data: is of one person, but there are several"),
        (("room.npz", "--anyway"), "--anyway: several people are not checked first; leave it out"),
    ],
)
def test_what_makes_no_sense_is_refused(arguments, message, folder):
    found = jaxskel("run", *arguments, "-o", "refused", cwd=folder)
    assert found.returncode == 2
    assert message in found.stderr
    assert not (folder / "refused").exists()
