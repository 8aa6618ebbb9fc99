"""Results that overlap with inputs or with other people's files are refused before anything is touched."""

import os
import re
import unicodedata
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
from support.files import some_poses
from support.listings import tree
from support.recording_folders import write_folder

from jaxskel.batch import Method, Source, check_places, find_sources, run_batch
from jaxskel.batch import _places as places
from jaxskel.io.poses import write_poses


@pytest.fixture
def world(tmp_path) -> Path:
    """W/walk (a recording), W/far (one whose masks, calibration and subject lie elsewhere), run.npz, a list."""
    write_folder(_made(tmp_path / "W/walk"))
    far = write_folder(_made(tmp_path / "W/far"))
    (tmp_path / "away").mkdir()
    for name in ("masks", "calibration.toml"):
        os.rename(far / name, tmp_path / "away" / name)
    (tmp_path / "away/person.toml").write_text("stature = 1.8\n")
    described = (far / "recording.toml").read_text().replace('"masks/', '"../../away/masks/')
    described = described.replace('"calibration.toml"', '"../../away/calibration.toml"')
    (far / "recording.toml").write_text('subject = "../../away/person.toml"\n' + described)
    np.savez(tmp_path / "run.npz", silhouettes=np.zeros(1))
    (tmp_path / "list.txt").write_text("W/walk\n")
    return tmp_path


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True)
    return folder


def refused(world: Path, inputs: list[str], output: str, told: str, subject: Path | None = None) -> None:
    before = tree(world)
    with chdir(world), pytest.raises(ValueError, match=told) as error:
        run_batch(find_sources(inputs), Path(output), Method(subject=subject))
    assert "\n" not in str(error.value)
    assert tree(world) == before


OVERLAPS = {
    "the folder of the recordings": (["W"], "W", "would be W/"),
    "the recording's parent": (["W/walk"], "W", "would be W/walk"),
    "the recording": (["W/walk"], "W/walk", "would lie in W/walk"),
    "within the recording": (["W/walk"], "W/walk/poses", "would lie in W/walk"),
    "by ..": (["W/walk"], "W/far/..", "would be W/walk"),
    "within a folder of masks elsewhere": (["W/far"], "away/masks/front", "would lie in"),
    "within the masks of another recording": (["W"], "W/walk/masks", "would lie in W/walk"),
    "a calibration in the result": (["W/far", "run.npz"], "other", "would hold"),
    "a subject in the result": (["W/far", "run.npz"], "third", "would hold"),
    "a list in the result": (["run/list.txt"], ".", "would hold run/list.txt"),
    "a sequence file in another one's result": (["out/run/poses.npz", "run.npz"], "out", "would be out/run/poses.npz"),
    "a link to the recording": (["W/walk"], "linked", "would be W/walk"),
    "a link to the folder above": (["W/walk"], "above", "would be W/walk"),
    "a hard link to the input": (["W/far"], "hard", "would be .*calibration.toml"),
    "a list that is the report of a failure": (["out/run.failed.json"], "out", "would be out/run.failed.json"),
}


@pytest.mark.parametrize("kind", OVERLAPS)
def test_overlaps_are_refused_and_nothing_is_touched(world, kind):
    inputs, output, told = OVERLAPS[kind]
    if kind.startswith("a calibration"):
        _made(world / "other/run")
        os.rename(world / "away/calibration.toml", world / "other/run/rig.toml")
        text = (world / "W/far/recording.toml").read_text()
        (world / "W/far/recording.toml").write_text(text.replace("away/calibration", "other/run/rig"))
    elif kind.startswith("a subject"):
        _made(world / "third/far")
        os.rename(world / "away/person.toml", world / "third/far/person.toml")
        text = (world / "W/far/recording.toml").read_text()
        (world / "W/far/recording.toml").write_text(text.replace("away/person", "third/far/person"))
    elif kind.startswith("a list in"):
        (_made(world / "run") / "list.txt").write_text("../run.npz\n")
    elif kind.startswith("a sequence"):
        np.savez(_made(world / "out/run") / "poses.npz", silhouettes=np.zeros(1))
    elif kind == "a link to the recording":
        _made(world / "linked")
        (world / "linked/walk").symlink_to("../W/walk")
    elif kind == "a link to the folder above":
        (world / "above").symlink_to("W")
    elif kind.startswith("a hard"):
        os.link(world / "away/calibration.toml", _made(world / "hard/far") / "poses.csv")
    elif kind.startswith("a list that"):
        (_made(world / "out") / "run.failed.json").write_text("../run.npz\n")
    refused(world, inputs, output, told)


def test_the_subject_of_all_is_an_input_too(world):
    os.rename(world / "away/person.toml", _made(world / "out/walk") / "person.toml")
    refused(world, ["W/walk"], "out", "would hold", world / "out/walk/person.toml")


@pytest.mark.parametrize("output", ["W/out", "out", "W/far/../results", "away/results"])
def test_what_is_harmless_is_not_refused(world, output):
    (world / output / "walk").mkdir(parents=True)
    (world / output / "walk/notes.txt").write_text("mine")
    before = tree(world)
    with chdir(world):
        check_places(find_sources(["W", "run.npz", "list.txt"]), Path(output))
    assert tree(world) == before


OTHERS = {
    "poses.npz": "a recording", "poses.csv": "somebody's table", "manifest.json": '{"of": "something else"}',
    "../walk.failed.json": "{}",
}  # fmt: skip


@pytest.mark.parametrize("name", OTHERS)
def test_files_of_others_are_not_replaced(world, name):
    _made(world / "out/walk")
    (world / "out/walk" / name).write_text(OTHERS[name])
    refused(world, ["W/walk"], "out", f"{re.escape(Path(name).name)}: was not written by jaxskel")


def test_a_recording_that_is_called_poses_is_not_replaced(world):
    with np.load(write_poses(world / "out/walk", some_poses())[0]) as poses:
        np.savez(world / "out/walk/poses.npz", silhouettes=np.zeros(1), **poses)
    refused(world, ["W/walk"], "out", "poses.npz: was not written by jaxskel")


def test_poses_of_jaxskel_run_are_replaced(world):
    write_poses(world / "out/walk", some_poses())
    with chdir(world):
        check_places(find_sources(["W/walk"]), Path("out"))


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda out: (out / "walk").write_text("mine"), "walk: is not a folder, but a folder is needed"),
        (lambda out: (out / "walk").symlink_to("gone"), "walk: is not a folder"),
        (lambda out: (out / "walk").symlink_to("../away"), "walk: is a link, but a result needs its own folder"),
        (lambda out: (out / ".locks").write_text("mine"), ".locks: is not a folder"),
        (lambda out: (out / ".walk.part").write_text("mine"), ".walk.part: is not a folder"),
        (lambda out: (out / ".walk.part").symlink_to("../away"), ".walk.part: is a link"),
        (lambda out: (out / "walk/poses.csv").mkdir(parents=True), "poses.csv: was not written by jaxskel"),
        (lambda out: os.mkfifo(_made(out / "walk") / "manifest.json"), "manifest.json: was not written by jaxskel"),
        (lambda out: (out.rmdir(), out.write_text("mine")), "out: cannot be written to"),
        (lambda out: (out.rmdir(), out.symlink_to("gone")), "out: cannot be written to"),
    ],
)
def test_what_is_in_the_way_is_told(world, make, told):
    make(_made(world / "out"))
    refused(world, ["W/walk"], "out", told)


def test_a_disk_that_is_full_or_may_not_be_written_is_told(world, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    refused(world, ["W/walk"], "new/out", "new/out: cannot be written to .No space left on device")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_told(world):
    _made(world / "out").chmod(0o500)
    refused(world, ["W/walk"], "out", "out: cannot be written to")


def test_names_that_a_disk_takes_for_the_same_are_refused_there(world, monkeypatch):
    names = ["Walk", "walk"], [unicodedata.normalize(form, "Café") for form in ("NFC", "NFD")]
    for one, other in names:
        sources = [Source(one, world / "W/walk"), Source(other, world / "W/far")]
        check_places(sources, world / "out")
        with monkeypatch.context() as patch:
            patch.setattr(places, "_tells_cases_apart", lambda output: False)
            with pytest.raises(ValueError, match="does not distinguish capitals from small letters"):
                check_places(sources, world / "out")


def test_two_results_in_one_place_are_refused(world):
    """Two folders of the output are the same folder because of a link."""
    _made(world / "out/real")
    (world / "out/alias").symlink_to("real")
    sources = [Source("real/a", world / "W/walk"), Source("alias/a", world / "W/far")]
    with pytest.raises(ValueError, match="would be in the same place as that of"):
        check_places(sources, world / "out")
