"""No command overwrites its inputs or files that jaxskel did not write: all files are compared before and after."""

import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.command_line import jaxskel
from support.own_outputs import CAMERAS, MINE
from support.poses import moving

from jaxskel import pack_silhouettes
from jaxskel._runtime import atomic_files as _files
from jaxskel._runtime.picture_files import write_figure, write_image
from jaxskel.body import default_adult
from jaxskel.io.calibrations import write_calibration, write_pose2sim_calibration
from jaxskel.io.files import is_ours
from jaxskel.io.poses import write_bvh, write_poses, write_table, write_trc
from jaxskel.io.recordings import write_recording
from jaxskel.io.subjects import write_subject
from jaxskel.recording import Recording


def files_of(folder: Path) -> dict[str, bytes | str]:
    """Everything below a folder, links and empty folders too."""
    return {
        str(path.relative_to(folder)): os.readlink(path) if path.is_symlink()
        else path.read_bytes() if path.is_file() else "folder" if path.is_dir() else "something else"
        for path in sorted(folder.rglob("*"))
    }  # fmt: skip


@pytest.fixture
def place(tmp_path) -> Path:
    """A sequence file, a folder with masks, poses, and what a user may have beside them."""
    masks = np.zeros((2, 3, 24, 32), bool)
    masks[:, :, 8:16, 12:20] = True
    recording = Recording(CAMERAS, pack_silhouettes(masks), 5.0, "+Z", np.arange(2))
    write_recording(tmp_path / "scene.npz", recording)
    write_poses(tmp_path / "out", moving(2))
    (tmp_path / "walk").mkdir()
    shutil.copy(tmp_path / "scene.npz", tmp_path / "walk" / "poses.npz")
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "poses.csv").symlink_to("../scene.npz")
    os.link(tmp_path / "out" / "poses.npz", tmp_path / "same.trc")
    rec = tmp_path / "rec"
    lines = ['fps = 5.0\nup = "+Z"\ncalibration = "Calib.toml"\nsubject = "own.toml"']
    for camera, name in enumerate(CAMERAS.names):
        (rec / name).mkdir(parents=True)
        lines += [f'[views.{name}]\nmasks = "{name}"']
        for frame in range(2):
            cv2.imwrite(str(rec / name / f"{frame}.png"), masks[frame, camera] * np.uint8(255))
    (rec / "recording.toml").write_text("\n".join(lines))
    (rec / "own.toml").write_text("stature = 1.75\n")
    write_pose2sim_calibration(rec / "Calib.toml", CAMERAS)
    (tmp_path / "link.toml").symlink_to("rec/Calib.toml")
    for name in ("a.mp4", "b.mp4", "masks.mp4"):
        (tmp_path / name).write_bytes(MINE)
    for name in ("poses.npz", "poses.csv", "score.json", "score.png", "scene.npz", "views.png"):
        (tmp_path / f"own {name}").mkdir()
        (tmp_path / f"own {name}" / name).write_bytes(MINE)
    for name in ("report.html", "check.png", "subject.toml", "refined.toml", "calibration.toml"):
        (tmp_path / name).write_bytes(MINE)
    shutil.copytree(tmp_path / "walk", tmp_path / "own recording")
    os.rename(tmp_path / "own recording" / "poses.npz", tmp_path / "own recording" / "scene.npz")
    os.mkfifo(tmp_path / "pipe.html")
    return tmp_path


BOARD = ("--board", "9x6", "--square", 0.1)
READ, THERE, KIND = "is read by this command", "jaxskel did not write it", "must be a f"

OVERLAPS = [
    (("run", "walk/poses.npz", "-o", "walk"), READ),
    (("run", "scene.npz", "-o", "linked"), READ),
    (("run", "scene.npz", "-o", "own poses.npz"), THERE),
    (("run", "scene.npz", "-o", "own poses.csv"), THERE),
    (("run", "scene.npz", "-o", "walk"), THERE),  # a recording, though its name is that of poses
    (("run", "rec", "-o", "rec/own.toml"), KIND),
    (("run", "scene.npz", "-o", "scene.npz/below"), "cannot be written"),
    (("run", "scene.npz", "-o", "x" * 300), "cannot be written"),
    (("export", "out/poses.npz", "same.trc"), READ),
    (("export", "out/poses.npz", "new.bvh", "out/poses.npz/a.trc"), "cannot be written"),
    (("report", "scene.npz", "out/poses.npz", "-o", "out/poses.npz"), READ),
    (("report", "scene.npz", "out/poses.npz", "-o", "scene.npz"), READ),
    (("report", "rec", "out/poses.npz", "-o", "rec/recording.toml"), READ),
    (("report", "rec/recording.toml", "out/poses.npz", "-o", "rec/own.toml"), READ),
    (("report", "scene.npz", "out/poses.npz", "-o", "rec"), KIND),
    (("report", "scene.npz", "out/poses.npz", "-o", "pipe.html"), KIND),
    (("report", "scene.npz", "out/poses.npz", "-o", "/dev/null"), KIND),
    (("report", "scene.npz", "out/poses.npz"), THERE),
    (("refine-cameras", "rec", "-o", "rec/Calib.toml"), READ),
    (("refine-cameras", "rec", "-o", "rec/../link.toml"), READ),
    (("refine-cameras", "scene.npz", "-o", "scene.npz"), READ),
    (("refine-cameras", "scene.npz"), THERE),
    (("calibrate-cameras", "a=a.mp4", "b=b.mp4", *BOARD, "--intrinsics", "rec/Calib.toml", "-o", "rec/Calib.toml"),
     READ),
    (("calibrate-cameras", "a=a.mp4", "b=b.mp4", *BOARD, "--intrinsics", "rec/Calib.toml", "-o", "a.mp4"), "ends in"),
    (("calibrate-cameras", "a=a.mp4", "b=link.toml", *BOARD, "--intrinsics", "a=b.mp4", "-o", "rec/Calib.toml"), READ),
    (("calibrate-cameras", "a=a.mp4", "b=b.mp4", *BOARD, "--intrinsics", "rec/Calib.toml"), THERE),
    (("calibrate-body", "rec", "-o", "rec/own.toml"), READ),
    (("calibrate-body", "rec", "-o", "rec/recording.toml"), READ),
    (("calibrate-body", "scene.npz"), THERE),
    (("check", "rec", "-o", "rec/cam0/1.png"), READ),
    (("check", "rec", "-o", "rec/cam0/check.png"), READ),  # would be the view's next image
    (("check", "scene.npz", "-o", "new/check"), "ends in"),
    (("check", "scene.npz", "-o", "new/check.xyz"), "ends in"),
    (("check", "scene.npz"), THERE),
    (("evaluate", "out/poses.npz", "out/poses.npz", "-o", "own score.json"), THERE),
    (("evaluate", "out/poses.npz", "out/poses.npz", "-o", "own score.png"), THERE),
    (("demo", "-o", "own recording"), THERE),
    (("demo", "-o", "own scene.npz"), THERE),
    (("demo", "-o", "own views.png"), THERE),
    (("init", "rec"), "exists already"),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "why"), OVERLAPS, ids=lambda value: " ".join(map(str, value))[:60])
def test_overlaps_are_refused_before_any_work(place, arguments, why):
    before = files_of(place)
    done = jaxskel(*arguments, cwd=place)
    assert done.returncode == 2, done.stdout
    assert why in done.stderr
    assert done.stderr.count("\n") == 1
    assert files_of(place) == before


def test_a_view_is_not_saved_over_what_it_shows(place):
    pytest.importorskip("rerun")
    shutil.copy(place / "scene.npz", place / "scene.rrd")
    before = files_of(place)
    done = jaxskel("view", "scene.rrd", "--save", "scene.rrd", cwd=place)
    assert (done.returncode, READ in done.stderr) == (2, True), done.stderr
    assert files_of(place) == before


def test_what_jaxskel_wrote_is_replaced_and_what_a_user_names_too(place):
    for _ in range(2):
        done = jaxskel("evaluate", "out/poses.npz", "out/poses.npz", "-o", "out", cwd=place)
        assert done.returncode == 0, done.stderr
    assert {path.name for path in (place / "out").iterdir()} == {"poses.npz", "poses.csv", "score.json", "score.png"}
    assert all(is_ours(path) for path in (place / "out").iterdir())
    (place / "mine.trc").write_bytes(MINE)
    done = jaxskel("export", "out/poses.npz", "mine.trc", cwd=place)
    assert done.returncode == 0, done.stderr
    assert (place / "mine.trc").read_bytes().startswith(b"PathFileType")


def test_only_what_jaxskel_wrote_is_known_as_such(place):
    written = {"a.png", "s.toml", "c.toml"}
    write_image(place / "a.png", np.zeros((4, 4, 3), np.uint8))
    write_subject(place / "s.toml", default_adult())
    write_pose2sim_calibration(place / "c.toml", CAMERAS)
    assert all(is_ours(place / name) for name in written)
    cv2.imwrite(str(place / "theirs.png"), np.zeros((4, 4, 3), np.uint8))
    others = (
        "theirs.png",
        "scene.npz",
        "rec/own.toml",
        "report.html",
        "a.mp4",
        "own poses.csv/poses.csv",
        "nowhere.csv",
    )
    assert not any(is_ours(place / name) for name in others)
    # A picture with the note is still a valid picture for other programs.
    assert cv2.imread(str(place / "a.png")).shape == (4, 4, 3)


WRITERS = {
    "a.png": lambda path: write_image(path, np.zeros((4, 4, 3), np.uint8)),
    "a.jpg": lambda path: write_image(path, np.zeros((4, 4, 3), np.uint8)),
    "figure.png": lambda path: write_figure(path, drawing(), 50),
    "figure.pdf": lambda path: write_figure(path, drawing(), 50),
    "poses.npz": lambda path: write_poses(path.parent, moving(2)),
    "poses.csv": lambda path: write_table(path, moving(2)),
    "a.trc": lambda path: write_trc(path, moving(2)),
    "a.bvh": lambda path: write_bvh(path, moving(2)),
    "s.toml": lambda path: write_subject(path, default_adult()),
    "c.toml": lambda path: write_pose2sim_calibration(path, CAMERAS),
    "c.npz": lambda path: write_calibration(path, CAMERAS, "+Z"),
}


def drawing():
    from matplotlib.figure import Figure

    figure = Figure()
    figure.subplots().plot([0, 1])
    return figure


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(28, "No space left on device")])
@pytest.mark.parametrize("name", WRITERS)
def test_a_write_that_breaks_off_leaves_what_was_there(tmp_path, monkeypatch, name, error):
    (tmp_path / name).write_bytes(MINE)

    def broken(*paths: Path) -> None:
        raise error

    monkeypatch.setattr(_files.os, "replace", broken)
    with pytest.raises((KeyboardInterrupt, OSError)):
        WRITERS[name](tmp_path / name)
    monkeypatch.undo()
    assert files_of(tmp_path) == {name: MINE}
    WRITERS[name](tmp_path / name)
    assert (tmp_path / name).read_bytes() != MINE


def test_checking_an_output_leaves_no_trace(tmp_path):
    _files.check_writable(tmp_path / "a" / "b" / "c.html")
    assert files_of(tmp_path) == {}
    (tmp_path / "file").write_bytes(MINE)
    for path in (tmp_path / "file" / "b" / "c.html", tmp_path / "a" / ("x" * 300), tmp_path / ("x" * 300) / "c.html"):
        with pytest.raises(ValueError, match="cannot be written"):
            _files.check_writable(path)
    assert files_of(tmp_path) == {"file": MINE}


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="the administrator may write anywhere")
def test_a_folder_without_permission_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(ValueError, match="cannot be written"):
        _files.check_writable(tmp_path / "c.html")


def test_a_full_disk_is_told_by_the_files_name(tmp_path, monkeypatch):
    with pytest.raises(OSError, match=r"a\.html"), _files.written_whole(tmp_path / "a.html"):
        raise OSError(28, "No space left on device")
    assert files_of(tmp_path) == {}
