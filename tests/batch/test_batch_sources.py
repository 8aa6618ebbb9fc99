"""Which recordings a batch is made of, and whether their files have changed."""

import glob
import os
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from jaxskel.batch import Shard, Source, find_sources
from jaxskel.batch import _inputs as inputs
from jaxskel.batch._inputs import read_inputs, same_contents
from jaxskel.batch._names import lock_name
from jaxskel.batch._search import matches
from jaxskel.io.recordings import input_paths


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """data/{a/walk.npz, a/poses.npz, b/walk.npz, b/run/recording.toml, .old/walk.npz, broken.npz}."""
    monkeypatch.chdir(tmp_path)
    for folder in ("data/a", "data/b/run", "data/.old"):
        (tmp_path / folder).mkdir(parents=True)
    for walk in ("data/a/walk.npz", "data/b/walk.npz", "data/.old/walk.npz"):
        np.savez(tmp_path / walk, silhouettes=np.zeros(1))
    np.savez(tmp_path / "data/a/poses.npz", joints=np.zeros(1))
    (tmp_path / "data/b/run/recording.toml").write_text("fps = 30.0\n")
    np.savez(tmp_path / "data/b/run/masks.npz", silhouettes=np.zeros(1))
    (tmp_path / "data/broken.npz").write_bytes(b"PK")
    return tmp_path


def names(*given):
    return [source.name for source in find_sources(given)]


def test_a_folder_is_searched_and_names_tell_the_place(tree):
    assert names("data") == ["a/walk", "b/run", "b/walk", "broken"]


def test_files_folders_and_patterns_are_named_by_themselves(tree):
    assert names("data/a/walk.npz") == ["walk"]
    assert names("data/b/run", "data/broken.npz") == ["broken", "run"]
    assert names("data/b/run/recording.toml") == ["run"]
    assert names("data/*/run") == ["run"]
    assert find_sources(["data/**/run"])[0].path == find_sources(["data/b/run"])[0].path


def test_what_is_given_twice_is_done_once(tree):
    assert names("data/a/walk.npz", "data/a/walk.npz", "data/a/*.npz") == ["poses", "walk"]


def test_people_with_masks_of_their_own_are_a_source_each(tree):
    (tree / "data/b/run/recording.toml").write_text("fps = 30.0\n[people.anna]\nperson = [1]\n[people.ben]\n")
    np.savez(tree / "data/b/walk.npz", silhouettes_carl=np.zeros(1), silhouettes_dora=np.zeros(1))
    found = {source.name: source for source in find_sources(["data/b"])}
    assert list(found) == ["run/anna", "run/ben", "walk/carl", "walk/dora"]
    assert {source.person for source in found.values()} == {"anna", "ben", "carl", "dora"}
    assert {str(source.path) for source in found.values()} == {"data/b/run", "data/b/walk.npz"}
    (tree / "data/b/run/recording.toml").write_text('fps = 30.0\n[people."../anna"]\nperson = [1]\n')
    assert names("data/b/run") == ["run"]  # reading it says what is wrong


def test_a_list_is_relative_to_its_own_place_and_keeps_what_is_not_there(tree):
    (tree / "data/list.txt").write_text("# mine\na/walk.npz\n\nb/run  # folder\ngone.npz\n")
    assert names("data/list.txt") == ["gone", "run", "walk"]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["data/gone.npz"], "data/gone.npz: there is no such file or folder; check the path"),
        (["data/*.mp4"], r"data/\*.mp4: matches nothing; check the pattern"),
        (["data/.old/empty"], "no recording is found"),
        (["data/a/walk.npz", "data/b/walk.npz"], "data/b/walk.npz: its result would be walk, as that of data/a/walk"),
        (["data/bytes.txt"], "data/bytes.txt: is neither a sequence file"),
        (
            ["data/.nested"],
            "data/.nested/a.npz: its result would be a, a folder that holds that of data/.nested/a/b.npz",
        ),
    ],
)
def test_refused(tree, given, told):
    (tree / "data/.old/empty").mkdir()
    (tree / "data/.nested/a").mkdir(parents=True)
    for name in ("a", "a/b"):
        np.savez(tree / f"data/.nested/{name}.npz", silhouettes=np.zeros(1))
    (tree / "data/bytes.txt").write_bytes(b"\xff\xfe\xff")
    with pytest.raises(ValueError, match=f"^{told}"):
        find_sources(given)


def test_dots_have_the_names_of_what_they_lead_to(tree, monkeypatch):
    monkeypatch.chdir(tree / "data/b/run")
    assert names(".") == names("../run") == names("../run/.") == names("recording.toml") == ["run"]
    (tree / "data/b/run/below").mkdir()
    monkeypatch.chdir(tree / "data/b/run/below")
    assert names("..") == names("../below/..") == ["run"]
    (tree / "data/b/list.txt").write_text("\ufeffrun/below/..\n")
    assert names("../../list.txt") == ["run"]


@pytest.mark.parametrize(
    "name", ["..npz", "...npz", ".hidden.npz", "walk.failed.json.npz", "Summary.CSV.npz", "poses.npz.npz",
             "manifest.json.npz", "a" * 240 + ".npz"],
)  # fmt: skip
def test_names_that_no_result_can_have_are_refused(tree, name):
    with open(tree / "data" / name, "wb") as file:  # with a path, NumPy would change the name
        np.savez(file, silhouettes=np.zeros(1))
    with pytest.raises(ValueError, match="its result would be called .*; rename it$"):
        names(f"data/{name}")
    (tree / "data/list.txt").write_text("gone\0.npz\n")
    with pytest.raises(ValueError, match="its result would be called"):
        names("data/list.txt")


def test_a_folder_is_searched_once_however_it_is_linked(tree):
    for name in ("a", "b"):
        (tree / "data/b" / f"to_{name}").symlink_to(".")
        (tree / "data" / f"up_{name}").symlink_to("../data")
    (tree / "data/itself").symlink_to("itself")
    (tree / "data/0_link").symlink_to("b/run")
    (tree / "elsewhere/c").mkdir(parents=True)
    np.savez(tree / "elsewhere/c/jump.npz", silhouettes=np.zeros(1))
    (tree / "data/linked").symlink_to("../elsewhere")
    everything = ["a/walk", "b/run", "b/walk", "broken", "linked/c/jump"]
    assert names("data") == everything
    assert names("data", "data/../data") == everything
    assert names("data/**/jump.npz") == ["jump"]
    assert names("data/**/run") == ["run"]
    assert sorted(matches("data/**")) == sorted({*matches("data/**"), "data", "data/b/run"})
    # A link given as input is used itself.
    assert names("data/0_link") == ["0_link"]


def test_patterns_mean_what_they_mean_for_glob(tree):
    for pattern in ("data/**/*.npz", "data/*/walk.npz", "**/a", "*/**/walk.npz", f"{tree}/data/**/walk.npz"):
        expected = {Path(path) for path in glob.glob(pattern, recursive=True)}
        assert {Path(path) for path in matches(pattern)} == expected


def test_lists_that_name_each_other_are_refused(tree):
    (tree / "data/one.txt").write_text("two.txt\na/walk.npz\n")
    (tree / "data/two.txt").write_text("b/../one.txt\n")
    with pytest.raises(ValueError, match="data/b/../one.txt: is a list that names itself; take it out"):
        names("data/one.txt")


def test_results_are_no_recordings_whatever_has_become_of_them(tree):
    result = tree / "data/out/walk"
    result.mkdir(parents=True)
    (result / "manifest.json").write_text('{\n "outcome": "done", cut')
    (result / "poses.npz").write_bytes(b"PK cut")
    assert names("data") == ["a/walk", "b/run", "b/walk", "broken"]


def test_what_is_no_regular_file_is_for_the_batch_to_report(tree):
    os.mkfifo(tree / "data/pipe.npz")
    (tree / "data/zero.npz").symlink_to("/dev/zero")
    (tree / "data/odd").mkdir()
    os.mkfifo(tree / "data/odd/recording.toml")
    assert names("data") == ["a/walk", "b/run", "b/walk", "broken", "odd", "pipe", "zero"]
    os.mkfifo(tree / "data/list.txt")
    with pytest.raises(ValueError, match="list.txt: is a FIFO"):
        names("data/list.txt")
    with pytest.raises(ValueError, match="an input is empty"):
        names("")


def test_a_folder_that_cannot_be_read_is_told(tree, monkeypatch):
    def closed(path):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(os, "scandir", closed)
    with pytest.raises(ValueError, match="^data: cannot be searched .Permission denied.; mend that"):
        names("data")


def test_folders_in_folders_are_searched_to_any_depth(tree):
    with chdir(tree / "data"):
        for _ in range(1200):
            os.mkdir("d")
            os.chdir("d")
        try:
            assert names(tree / "data")[:2] == ["a/walk", "b/run"]
        finally:  # the clean-up after the tests cannot delete folders nested this deep
            for _ in range(1200):
                os.chdir("..")
                os.rmdir("d")


@given(st.lists(st.text(st.characters(exclude_characters="\0"), min_size=1, max_size=300), min_size=2, max_size=2))
@example(["a/b", "a__b"])
@example(["a/b", "a%2Fb"])
@example(["a" * 300, "a" * 299 + "b"])
@example(["\udcff", "\xff"])
def test_locks_of_different_results_have_different_names_that_fit(given):
    try:
        locks = [lock_name(os.fsdecode(name.encode(errors="surrogateescape"))) for name in given]
    except UnicodeEncodeError:  # not a valid file name
        return
    assert len(set(locks)) == len(set(given))
    assert all(len(os.fsencode(lock)) < 200 and "/" not in lock for lock in locks)


@pytest.mark.parametrize("of", [1, 2, 3, 7, 20])
def test_shards_are_a_partition(of):
    sources = [Source(f"{i}", Path(__file__)) for i in range(10)]
    parts = [Shard(number + 1, of).part(sources) for number in range(of)]
    assert sorted(source.name for part in parts for source in part) == sorted(s.name for s in sources)
    assert max(map(len, parts)) - min(map(len, parts)) <= 1
    for number in (0, of + 1):
        with pytest.raises(ValueError, match=f"shard {number}/{of}: give"):
            Shard(number, of)


def test_files_of_a_recording(tmp_path):
    (tmp_path / "masks").mkdir()
    (tmp_path / "masks/0.png").write_bytes(b"0")
    for name in ("recording.toml", "rig.toml", "subject.toml", "m.npz", "unused.txt"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "recording.toml").write_text(
        'calibration = "rig.toml"\n[views.a]\nmasks = "masks"\n[views.b]\nmasks = "m.npz:b"\n[views.c]\nplate = "gone"'
    )
    assert input_paths(tmp_path) == {
        "recording.toml": tmp_path / "recording.toml", "rig.toml": tmp_path / "rig.toml", "masks": tmp_path / "masks",
        "subject.toml": tmp_path / "subject.toml", "m.npz:b": tmp_path / "m.npz",
    }  # fmt: skip
    (tmp_path / "recording.toml").write_text("calibration = [")
    assert set(input_paths(tmp_path)) == {"recording.toml", "subject.toml"}


def test_what_counts_is_content_and_it_is_read_only_when_a_time_or_size_changed(tmp_path, monkeypatch):
    masks, rig = tmp_path / "masks", tmp_path / "rig"
    masks.mkdir()
    (masks / "0.png").write_bytes(b"0")
    rig.write_bytes(b"rig")
    paths = {"masks": masks, "rig": rig}
    before = read_inputs(paths)
    assert before["rig"].bytes == 3
    os.utime(rig, ns=(1, 1))
    touched = read_inputs(paths, before)
    assert touched["rig"].stamp != before["rig"].stamp
    assert same_contents(touched, before)
    (masks / "1.png").write_bytes(b"")
    assert not same_contents(read_inputs(paths, before), before)
    (masks / "1.png").unlink()
    (masks / "0.png").rename(masks / "1.png")
    assert not same_contents(read_inputs(paths, before), before)
    known = read_inputs(paths)
    monkeypatch.setattr(inputs, "_content", lambda *_: pytest.fail("read again"))
    assert read_inputs(paths, known) == known
