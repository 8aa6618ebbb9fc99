"""Files that are changed while they are read, and results that are changed after they are written."""

import json
import os
import shutil
from dataclasses import asdict
from pathlib import Path

import pytest
from support.faked_batch import Killed, fake, faked_source
from support.listings import tree
from support.recording_folders import write_folder

from jaxskel import HullSettings, Settings
from jaxskel.batch import Method, Outcome, Source, check_places, finished_before
from jaxskel.batch import _one as one
from jaxskel.batch._manifest import read_manifest
from jaxskel.batch._one import reconstruct_one
from jaxskel.io.calibrations import read_calibration, write_easymocap_calibration
from jaxskel.io.poses import read_poses

METHOD = Method()


@pytest.fixture
def place(tmp_path, monkeypatch):
    return faked_source(tmp_path), tmp_path / "out", fake(monkeypatch)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    return Source("r", write_folder(_made(tmp_path / "r"))), tmp_path / "out", fake(monkeypatch)


def _made(path: Path) -> Path:
    path.mkdir()
    return path


def _rewritten(path: Path) -> None:
    """A change that keeps size and modification time."""
    state = path.stat()
    path.write_bytes(path.read_bytes())
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))


def _shortened(root: Path) -> None:
    for view in (root / "masks").iterdir():
        max(view.iterdir()).unlink()


def _and_back(change):
    """Make a change and undo it, so that contents, sizes and times are as before."""

    def both(root: Path) -> None:
        shutil.copytree(root, root.with_name("kept"), copy_function=shutil.copy2)
        change(root)
        for path in root.with_name("kept").rglob("*"):
            if path.is_file():
                place = root / path.relative_to(root.with_name("kept"))
                place.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(path, place)
        shutil.rmtree(root.with_name("kept"))

    return both


def _swapped(root: Path) -> None:
    os.rename(root / "masks/front", root / "masks/put away")
    shutil.copytree(root / "masks/left", root / "masks/front")
    shutil.rmtree(root / "masks/front")
    os.rename(root / "masks/put away", root / "masks/front")


FIRST = "masks/front/000000.png"
CHANGES = {
    "an image is written": lambda root: (root / FIRST).write_bytes((root / FIRST).read_bytes()),
    "an image is written, its time kept": lambda root: _rewritten(root / FIRST),
    "an image is another one for a while": _and_back(lambda root: (root / FIRST).write_bytes(b"another one")),
    "a file comes": lambda root: shutil.copy(root / FIRST, f"{root}/masks/front/{len(list(root.rglob('*')))}.txt"),
    "a file comes and goes": lambda root: (shutil.copy(root / FIRST, root / "x.png"), os.remove(root / "x.png")),
    "images go": _shortened,
    "a folder is another one for a while": _swapped,
    "the calibration": lambda root: (root / "calibration.toml").write_text((root / "calibration.toml").read_text()),
    "recording.toml": lambda root: (root / "recording.toml").write_text((root / "recording.toml").read_text() + "\n"),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", CHANGES)
def test_changed_once_it_is_started_over_and_changed_again_it_fails(folder, kind):
    source, output, batches = folder
    happened = []

    def change(done, total):
        """When the last batch is done, before it is written."""
        if done == total and len(happened) < times:
            happened.append(done)
            CHANGES[kind](source.path)

    times = 1
    found = reconstruct_one(source, output, METHOD, on_frames=change)
    assert (found.outcome, batches, found.resumed) == (Outcome.DONE, [0, 0], 0)
    assert found.told.endswith("; started over, because its files were changed while they were read")
    assert found == finished_before(source, output, METHOD)
    times, before = 3, tree(output / "r")
    happened.clear()
    found = reconstruct_one(source, output, METHOD, "again", change)
    assert found.outcome is Outcome.FAILED
    assert found.problem is not None
    assert found.problem.startswith(f"{source.path}: was changed while it was read, and again ")
    assert tree(output / "r") == before


def test_a_fault_that_is_of_a_file_in_the_making_is_not_the_last_word(folder, monkeypatch):
    source, output, _ = folder
    whole = (source.path / FIRST).read_bytes()
    (source.path / FIRST).write_bytes(whole[:30])

    read = Method.read

    def then_whole(method, path, person):
        try:
            return read(method, path, person=person)
        except ValueError:
            (source.path / FIRST).write_bytes(whole)
            raise

    monkeypatch.setattr(Method, "read", then_whole)
    found = reconstruct_one(source, output, METHOD)
    assert found.outcome is Outcome.DONE
    assert found.note.startswith("started over")


def test_poses_of_other_files_are_not_gone_on_with_though_the_files_are_back(place):
    source, output, batches = place
    count = iter(range(10))

    def broken_off(done, total):
        if next(count) == 2:
            raise Killed

    with pytest.raises(Killed):
        reconstruct_one(source, output, METHOD, on_frames=broken_off)
    assert batches == [0, 32]
    kept = source.path.with_name("kept")
    os.rename(source.path, kept)
    source.path.write_bytes(b"another one")
    os.replace(kept, source.path)
    batches.clear()
    assert reconstruct_one(source, output, METHOD).resumed == 0
    assert batches == [0, 32, 64]


def test_the_other_file_of_a_calibration_counts(tmp_path, monkeypatch):
    fake(monkeypatch)
    root = write_folder(_made(tmp_path / "r"))
    write_easymocap_calibration(root, read_calibration(root / "calibration.toml").cameras)
    described = (root / "recording.toml").read_text().replace("calibration.toml", "intri.yml")
    (root / "recording.toml").write_text('up = "+Z"\n' + described)
    source = Source("r", root)
    assert reconstruct_one(source, tmp_path / "out", METHOD).outcome is Outcome.DONE
    assert finished_before(source, tmp_path / "out", METHOD) is not None
    (root / "extri.yml").write_text((root / "extri.yml").read_text() + "\n")
    assert finished_before(source, tmp_path / "out", METHOD) is None


def test_what_somebody_has_changed_is_set_aside(place):
    source, output, _ = place
    reconstruct_one(source, output, METHOD)
    table = output / "walk/poses.csv"
    whole = tree(output / "walk")
    for number in range(3):
        table.write_text(f"mine {number}")
        (output / "walk/report.html").write_text("mine")
        assert finished_before(source, output, METHOD) is None
        found = reconstruct_one(source, output, METHOD)
        aside = f"poses.csv.changed{number or ''}"
        assert found.told.endswith(f"; changed files were renamed to {aside}")
        assert (output / "walk" / aside).read_text() == f"mine {number}"
        whole[aside] = f"mine {number}".encode()
    now = tree(output / "walk")
    assert {name: now[name] for name in whole if name != "manifest.json"} == {
        name: content for name, content in whole.items() if name != "manifest.json"
    }
    assert now["report.html"] == b"mine"


@pytest.mark.parametrize("name", ["poses.npz", "poses.csv"])
def test_a_result_that_is_damaged_is_made_again(place, name):
    source, output, _ = place
    reconstruct_one(source, output, METHOD)
    whole = (output / "walk" / name).read_bytes()
    (output / "walk" / name).write_bytes(whole[: len(whole) // 2])
    assert finished_before(source, output, METHOD) is None
    reconstruct_one(source, output, METHOD)
    assert (output / "walk" / name).read_bytes() == whole


def test_a_damaged_manifest_is_written_again_and_another_one_is_not(place):
    source, output, _ = place
    first = reconstruct_one(source, output, METHOD)
    manifest = output / "walk/manifest.json"
    manifest.write_bytes(manifest.read_bytes()[:100])
    check_places([source], output)
    assert reconstruct_one(source, output, METHOD).work == first.work
    manifest.write_text('{"name": "an app"}')
    found = reconstruct_one(source, output, METHOD)
    assert "was not written by jaxskel" in str(found.problem)
    assert manifest.read_text() == '{"name": "an app"}'


def test_results_of_before_manifests_told_of_their_files_are_done(place):
    source, output, _ = place
    found = reconstruct_one(source, output, METHOD)
    table = asdict(found)
    del table["results"], table["note"]
    (output / "walk/manifest.json").write_text(json.dumps(table, indent=1))
    before = finished_before(source, output, METHOD)
    assert before is not None
    assert (before.work, before.frames) == (found.work, 70)
    reconstruct_one(source, output, Method(Settings(hull=HullSettings(spacing=0.02))))
    assert sorted(os.listdir(output / "walk")) == ["manifest.json", "poses.csv", "poses.npz"]


def test_a_result_that_an_earlier_version_left_beside_its_place_takes_it(place):
    """That version renamed the hidden folder once it was complete; if killed before, it stayed hidden."""
    source, output, batches = place
    found = reconstruct_one(source, output, METHOD)
    table = asdict(found)
    del table["results"], table["note"]
    (output / "walk/manifest.json").write_text(json.dumps(table, indent=1))
    os.rename(output / "walk", output / ".walk.part")
    (output / ".walk.part/journal").mkdir()
    (output / ".walk.part/journal/rows.bin").write_bytes(b"")
    batches.clear()
    assert reconstruct_one(source, output, METHOD).work == found.work
    assert (batches, sorted(os.listdir(output))) == ([], [".locks", "walk"])


def test_what_else_is_in_hidden_folders_stays(place):
    source, output, _ = place
    (output / ".walk.part/journal").mkdir(parents=True)
    for name in (".walk.part/mine.txt", ".walk.part/journal/mine.txt", ".walk.old"):
        (output / name).write_text("mine")
    assert reconstruct_one(source, output, METHOD).outcome is Outcome.DONE
    for name in (".walk.part/mine.txt", ".walk.part/journal/mine.txt", ".walk.old"):
        assert (output / name).read_text() == "mine"
    assert sorted(os.listdir(output / ".walk.part/journal")) == ["mine.txt"]


def test_a_file_that_comes_into_the_way_during_the_work_stays_and_the_work_is_kept(place):
    source, output, batches = place

    def come(done, total):
        if done == total:
            (output / "walk").mkdir()
            (output / "walk/poses.csv").write_text("mine")

    found = reconstruct_one(source, output, METHOD, on_frames=come)
    assert "poses.csv: was not written by jaxskel" in str(found.problem)
    assert (output / "walk/poses.csv").read_text() == "mine"
    os.rename(output / "walk/poses.csv", output / "mine.csv")
    batches.clear()
    assert reconstruct_one(source, output, METHOD).outcome is Outcome.DONE
    assert batches == []
    assert len(read_poses(output / "walk/poses.npz")) == 70


def test_a_report_of_somebody_else_is_not_overwritten(place, monkeypatch):
    source, output, _ = place
    output.mkdir()
    (output / "walk.failed.json").write_text("{}")
    for _ in range(2):
        found = reconstruct_one(source, output, METHOD)
        assert "walk.failed.json: was not written by jaxskel" in str(found.problem)
        assert (output / "walk.failed.json").read_text() == "{}"
    os.remove(output / "walk.failed.json")
    with monkeypatch.context() as patch:
        patch.setattr(one, "prepare", lambda *_: [][0])
        assert reconstruct_one(source, output, METHOD) == read_manifest(output / "walk.failed.json")
