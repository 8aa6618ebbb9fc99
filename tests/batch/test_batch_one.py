"""One recording of a batch: done once, done again after a change, never left incomplete."""

import os
import shutil
from dataclasses import replace

import numpy as np
import pytest
from filelock import FileLock
from support.faked_batch import Killed, fake, faked_source
from support.random_poses import some_poses
from support.recording_folders import write_folder

from jaxskel import HullSettings, Settings, Status
from jaxskel._runtime.code_digest import digest_of_definitions
from jaxskel.batch import Method, Outcome, ResultFolder, Source, _manifest, _reading, finished_before, read_results
from jaxskel.batch import _one as one
from jaxskel.batch._manifest import read_manifest
from jaxskel.batch._one import reconstruct_one
from jaxskel.io.poses import read_poses

METHOD = Method()


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A recording of 70 frames whose poses are random numbers seeded by the frame; and a folder for the result."""
    return faked_source(tmp_path), tmp_path / "out", fake(monkeypatch)


def test_done_once(place):
    source, output, batches = place
    first = reconstruct_one(source, output, METHOD)
    assert (first.outcome, first.frames, first.with_pose, batches) == (Outcome.DONE, 70, 70, [0, 32, 64])
    assert len(read_poses(output / "walk" / "poses.npz")) == 70
    assert reconstruct_one(source, output, METHOD) == first == finished_before(source, output, METHOD)
    assert batches == [0, 32, 64]
    assert sorted(os.listdir(output)) == [".locks", "walk"]
    assert sorted(os.listdir(output / "walk")) == ["manifest.json", "poses.csv", "poses.npz"]


def test_done_again_once_for_each_request(place):
    source, output, batches = place
    reconstruct_one(source, output, METHOD)
    again = reconstruct_one(source, output, METHOD, "again")
    assert len(batches) == 6
    # A task that a cluster restarts repeats the same request.
    assert reconstruct_one(source, output, METHOD, "again") == again == finished_before(source, output, METHOD)
    assert finished_before(source, output, METHOD, "once more") is None
    assert len(batches) == 6


def test_done_again_when_something_changed(place, monkeypatch):
    source, output, _ = place
    reconstruct_one(source, output, METHOD)
    os.utime(source.path, ns=(1, 1))
    assert finished_before(source, output, METHOD) is not None
    assert finished_before(source, output, Method(Settings(hull=HullSettings(spacing=0.02)))) is None
    assert finished_before(source, output, Method(smooth_hz=2.0)) is None
    with monkeypatch.context() as patch:
        patch.setattr(_reading, "current_version", lambda: "another")
        assert finished_before(source, output, METHOD) is None
    (output / "walk" / "poses.csv").rename(output / "poses.csv")
    assert finished_before(source, output, METHOD) is None
    (output / "poses.csv").rename(output / "walk" / "poses.csv")
    source.path.write_bytes(source.path.read_bytes() + b" ")
    assert finished_before(source, output, METHOD) is None


def test_a_version_counts_its_code(monkeypatch):
    monkeypatch.setattr(_manifest, "version", lambda name: "1.2.3")
    assert _manifest.current_version.__wrapped__() == f"1.2.3+{digest_of_definitions()[:12]}"
    monkeypatch.setattr(_manifest, "digest_of_definitions", lambda: "0123456789abcdef")
    assert _manifest.current_version.__wrapped__() == "1.2.3+0123456789ab"


@pytest.mark.slow
@pytest.mark.parametrize("before", [0, 1])
@pytest.mark.parametrize("step", range(30))
def test_killed_at_any_step_a_result_with_a_manifest_is_whole(place, monkeypatch, before, step):
    """Processing is stopped at each call that changes the disk in turn, and then resumed."""
    source, output, batches = place
    monkeypatch.setattr(one, "doubts_before_work", lambda *_: [])  # it changes nothing on the disk, and takes longest
    if before:
        old = reconstruct_one(source, output, Method(Settings(hull=HullSettings(spacing=0.02))))
        assert old.outcome is Outcome.DONE
        (output / "walk" / "notes.txt").write_text("mine")
    steps = iter(range(100))

    def killed_at(function):
        def called(*arguments, **keywords):
            if next(steps) == step:
                raise Killed
            return function(*arguments, **keywords)

        return called

    was_killed = False
    with monkeypatch.context() as patch:
        for name in ("rename", "replace", "fsync", "unlink", "rmdir"):
            patch.setattr(os, name, killed_at(getattr(os, name)))
        try:
            reconstruct_one(source, output, METHOD)
        except Killed:
            was_killed = True
    assert was_killed == (step < next(steps))
    if (output / "walk/manifest.json").exists():
        manifest = ResultFolder(output, "walk").finished()
        assert manifest is not None
        assert len(read_poses(output / "walk" / "poses.npz")) == manifest.frames == 70
    batches.clear()
    found = reconstruct_one(source, output, METHOD)
    assert (found.outcome, found.frames) == (Outcome.DONE, 70)
    assert found.resumed == (batches[0] if batches else 70) or not batches
    assert sorted(os.listdir(output)) == [".locks", "walk"]
    notes = ["notes.txt"] if before else []
    assert sorted(os.listdir(output / "walk")) == ["manifest.json", *notes, "poses.csv", "poses.npz"]
    np.testing.assert_array_equal(read_poses(output / "walk" / "poses.npz").frame_index, np.arange(70))


@pytest.mark.parametrize("left", [0.9, 0.5, 0.02])
def test_a_video_that_was_cut_short_fails_and_its_older_result_stays(place, left):
    source, output, batches = place
    folder = source.path.parent / "filmed"
    folder.mkdir()
    source = Source("filmed", write_folder(folder, "video"))
    first = reconstruct_one(source, output, METHOD)
    assert (first.outcome, len(batches)) == (Outcome.DONE, 1)
    video = folder / "front.avi"
    video.write_bytes(video.read_bytes()[: int(left * video.stat().st_size)])
    found = reconstruct_one(source, output, METHOD)
    assert (found.outcome, len(batches)) == (Outcome.FAILED, 1)
    assert "front" in str(found.problem)
    assert read_manifest(output / "filmed" / "manifest.json") == first


def test_taken_up_within_the_recording_it_is_byte_for_byte_the_same(place, monkeypatch):
    source, output, batches = place
    reconstruct_one(source, output, METHOD)
    appended = iter(range(10))

    def broken_off(done, total):
        if next(appended) == 2:  # after the start and two batches
            raise Killed

    with pytest.raises(Killed):
        reconstruct_one(source, output / "other", METHOD, on_frames=broken_off)
    assert not (output / "other" / "walk").exists()
    batches.clear()
    shutil.copytree(output / "other", output / "anew")
    again = reconstruct_one(source, output / "other", METHOD)
    assert (batches, again.resumed) == ([64], 64)
    anew = reconstruct_one(source, output / "anew", METHOD, "again")
    assert (batches[1:], anew.resumed, anew.frames) == ([0, 32, 64], 0, 70)
    for name in ("poses.npz", "poses.csv"):
        assert (output / "other" / "walk" / name).read_bytes() == (output / "walk" / name).read_bytes()


def test_failures_are_told_and_the_old_result_stays(place, monkeypatch):
    source, output, _ = place
    whole = source.path.read_bytes()
    reconstruct_one(source, output, METHOD)
    source.path.write_bytes(whole[:5000])
    found = reconstruct_one(source, output, METHOD)
    assert found.outcome is Outcome.FAILED
    assert found.problem is not None
    assert found.problem.startswith(f"{source.path}: ")
    assert found.trace is None
    assert read_manifest(output / "walk.failed.json") == found
    assert read_results(output) == {"walk": found}
    assert len(read_poses(output / "walk" / "poses.npz")) == 70
    source.path.write_bytes(whole)
    assert reconstruct_one(source, output, METHOD).outcome is Outcome.DONE
    assert not (output / "walk.failed.json").exists()


def test_a_full_disk_is_a_failure_of_its_recording(place, monkeypatch):
    source, output, _ = place

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        found = reconstruct_one(source, output, METHOD)
    assert found.outcome is Outcome.FAILED
    assert "No space left on device" in str(found.problem)
    assert not (output / "walk").exists()
    assert reconstruct_one(source, output, METHOD).outcome is Outcome.DONE


def test_a_defect_of_the_package_is_a_failure_with_a_trace(place, monkeypatch):
    source, output, _ = place
    monkeypatch.setattr(one, "prepare", lambda recording, settings: [][0])
    found = reconstruct_one(source, output, METHOD)
    assert found.outcome is Outcome.FAILED
    assert "IndexError: list index out of range; please report it, with walk.failed.json" in str(found.problem)
    assert "Traceback" in str(found.trace)


def test_two_processes_do_not_work_at_one_recording(place, monkeypatch):
    source, output, batches = place
    monkeypatch.setattr(one, "_PATIENCE", 0.05)
    signs = []
    lock = ResultFolder(output, "walk").lock
    lock.parent.mkdir(parents=True)
    with FileLock(lock):
        found = reconstruct_one(source, output, METHOD, on_sign=signs.append)
    assert found.problem == f"{source.path}: another process works on it; wait until it has finished"
    assert signs == ["waiting for another process that works on it"]
    assert not batches
    assert not (output / "walk.failed.json").exists()


def test_no_pose_in_any_frame_is_done_but_told(place, monkeypatch):
    source, output, _ = place

    def empty(first, track, recording, settings, prepared):
        poses = some_poses(0, 70)
        nothing = poses.joints * np.nan
        yield replace(poses, status=poses.status * 0 + Status.EMPTY, joints=nothing), None

    monkeypatch.setattr(one, "batches_from", empty)
    found = reconstruct_one(source, output, METHOD)
    assert (found.outcome, found.with_pose, found.counts) == (Outcome.NO_POSE, 0, {"empty": 70})
    assert found.confidence is None
    assert "no pose in any frame: no view shows a person" in str(found.problem)
    assert finished_before(source, output, METHOD) == found
    assert read_results(output) == {"walk": found}


@pytest.mark.parametrize("hertz", [0.0, 2.5, 100.0])
def test_impossible_filters_are_refused(place, hertz):
    source, output, _ = place
    found = reconstruct_one(source, output, Method(smooth_hz=hertz))
    assert f"a cutoff of {hertz:g} Hz; give one between 0 and 2.5 Hz" in str(found.problem)


def test_inputs_that_are_no_regular_files_are_refused_and_not_read(tmp_path, monkeypatch):
    fake(monkeypatch)
    (tmp_path / "r").mkdir()
    root = write_folder(tmp_path / "r")
    others = {"zero": "/dev/zero", "fifo": root / "fifo", "link": root / "link"}
    os.mkfifo(root / "fifo")
    (root / "link").symlink_to("fifo")
    for name, target in others.items():
        described = (root / "recording.toml").read_text().replace("calibration.toml", str(target))
        other = tmp_path / name
        other.mkdir()
        shutil.copytree(root / "masks", other / "masks")
        (other / "recording.toml").write_text(described)
        found = reconstruct_one(Source(name, other), tmp_path / "out", METHOD)
        assert found.problem is not None
        assert str(target) in found.problem
        assert "no regular file" in found.problem
    for name in ("masks/front/000000.png", "recording.toml", "calibration.toml"):
        (root / name).unlink()
        os.mkfifo(root / name)
        found = reconstruct_one(Source("r", root), tmp_path / "out", METHOD)
        assert found.outcome is Outcome.FAILED
        assert "\n" not in str(found.problem)
    os.mkfifo(tmp_path / "x.npz")
    found = reconstruct_one(Source("x", tmp_path / "x.npz"), tmp_path / "out", METHOD)
    assert "no regular file" in str(found.problem)


def test_a_recording_toml_that_would_take_hours_is_refused_as_it_is_by_run(tmp_path, monkeypatch):
    """The files of a recording are found by the same bounded reader that reads it."""
    batches = fake(monkeypatch)
    (tmp_path / "r").mkdir()
    root = write_folder(tmp_path / "r")
    (root / "recording.toml").write_text((root / "recording.toml").read_text() + "a." * 40_000 + "a = 1\n")
    with pytest.raises(ValueError, match="recording.toml: ") as error:
        METHOD.read(root)
    found = reconstruct_one(Source("r", root), tmp_path / "out", METHOD)
    assert (found.outcome, found.problem, batches) == (Outcome.FAILED, str(error.value), [])
