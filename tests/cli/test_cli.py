"""The command line, run as its users run it: exit codes, last lines, written files."""

import io
import json
import subprocess
from pathlib import Path

import equinox as eqx
import numpy as np
import pytest
from rich.console import Console
from support.command_line import by_itself, jaxskel
from support.people import film_person, other_person
from support.poses import moving
from support.scenes import frames_of_scene

from jaxskel import JOINT_NAMES, Settings, paper_settings
from jaxskel.cli._demo import _speed
from jaxskel.cli._progress import StageTimes, doubt
from jaxskel.io.poses import read_poses, read_truth
from jaxskel.io.recordings import write_recording
from jaxskel.io.subjects import read_body, read_subject
from jaxskel.poses import STATUS_NAMES
from jaxskel.synthetic import make_scene


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A sequence file of raised hands with one empty frame."""
    folder = tmp_path_factory.mktemp("cli")
    scene = frames_of_scene(21, slice(15, None))
    scene.silhouettes[4] = 0
    write_recording(folder / "scene.npz", scene)
    return folder


@pytest.fixture(scope="module")
def ran(folder) -> subprocess.CompletedProcess:
    return jaxskel("run", "scene.npz", "-o", "out", cwd=folder)


def test_run_writes_poses_and_says_so(folder, ran):
    assert ran.returncode == 0, ran.stderr
    last = ran.stdout.strip().splitlines()[-1]
    assert "poses.npz" in last
    assert "6 frames, 5 with a pose, 1 without (" in last
    assert "1 empty)" in last
    with np.load(folder / "out" / "poses.npz") as file:
        assert file["joints"].shape == (6, 15, 3)
        assert file["joints"].dtype == np.float32
        assert np.isnan(file["joints"][4]).all()
        assert np.isfinite(np.delete(file["joints"], 4, 0)).all()
        assert tuple(file["joint_names"]) == JOINT_NAMES
        assert tuple(file["status_names"]) == STATUS_NAMES
        assert file["status_names"][file["status"][4]] == "empty"
        assert ((file["confidence"] >= 0) & (file["confidence"] <= 1)).all()
        assert str(file["up"]) == "+Z"
        assert file["fps"] == 5.0
        assert file["frame_index"].tolist() == list(range(15, 21))
    rows = (folder / "out" / "poses.csv").read_text().splitlines()
    assert len(rows) == 7
    assert rows[5].split(",")[2] == "empty"


def test_evaluate_scores_and_draws(folder, ran):
    done = jaxskel("evaluate", "out/poses.npz", "scene.npz", "-o", "score", cwd=folder)
    assert done.returncode == 0, done.stderr
    figures = json.loads((folder / "score" / "score.json").read_text())
    assert "out" in done.stdout
    assert (folder / "score" / "score.png").stat().st_size > 1000
    assert figures["frames"] == 6


def test_evaluate_refuses_the_truth_of_other_frames(folder, ran):
    write_recording(folder / "short.npz", make_scene(2))
    done = jaxskel("evaluate", "out/poses.npz", "short.npz", cwd=folder)
    assert done.returncode == 2
    assert "short.npz: frame 15 is missing" in done.stderr


def test_check_draws_every_view(folder):
    done = jaxskel("check", "scene.npz", "-o", "check.png", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert (folder / "check.png").stat().st_size > 10_000
    assert "cam7" in done.stdout
    assert "litres" in done.stdout
    assert "check.png" in done.stdout.strip().splitlines()[-1]


@pytest.mark.slow
def test_demo_does_the_whole_job(tmp_path):
    done = jaxskel("demo", "-o", "demo", "--frames", "4", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    written = {path.name for path in (tmp_path / "demo").iterdir()}
    wanted = {"scene.npz", "poses.npz", "poses.csv", "score.json", "score.png", "views.png", "stages.png"}
    assert written == wanted
    assert "4 frames, 4 with a pose" in done.stdout
    assert read_poses(tmp_path / "demo" / "poses.npz").has_pose.all()
    assert json.loads((tmp_path / "demo" / "score.json").read_text())["sides_counted"]["median_mm"] < 15


def test_speed_is_that_of_later_batches():
    times = StageTimes()
    times.first, times.later, times.later_frames = {"carve": 7.0}, {"carve": 0.5, "search": 4.5}, 10
    assert str(times) == "start-up 7.0 s, then 2.0 fps"
    out = io.StringIO()
    Console(file=out, width=80).print(_speed(times))
    rows = [line.split() for line in out.getvalue().splitlines()]
    figures = {row[1]: (row[3], row[5]) for row in rows if len(row) == 7}
    assert figures == {"carve": ("50.0", "20"), "search": ("450.0", "2"), "all": ("500.0", "2")}


@pytest.mark.slow
def test_subject_file_gives_the_bone_lengths(folder):
    (folder / "subject.toml").write_text("stature = 1.80\n[lengths]\nupper_arm = 0.35\n")
    done = jaxskel("run", "scene.npz", "-o", "tall", "--subject", "subject.toml", "--preset", "paper", cwd=folder)
    assert done.returncode == 0, done.stderr
    joints = read_poses(folder / "tall" / "poses.npz").joints[0]
    assert np.linalg.norm(joints[4] - joints[3]) == pytest.approx(0.35, abs=1e-5)


@pytest.mark.slow
def test_preset_paper_takes_a_raised_hand_for_the_head(folder, ran):
    done = jaxskel("run", "scene.npz", "-o", "paper", "--preset", "paper", cwd=folder)
    assert done.returncode == 0, done.stderr
    truth, *_ = read_truth(folder / "scene.npz")
    heads = {}
    for output in ("out", "paper"):
        joints = np.delete(read_poses(folder / output / "poses.npz").joints - truth.joints, 4, 0)
        heads[output] = np.linalg.norm(joints[:, 2], axis=-1).max()
    assert heads["out"] < 0.05
    assert heads["paper"] > 0.1


@pytest.mark.parametrize(("settings", "word"), [(Settings(), "silhouettes"), (paper_settings(), "preset")])
def test_what_to_do_about_poses_of_low_confidence_depends_on_how_they_were_made(settings, word):
    sure = moving(12)
    assert doubt(sure, settings) is None
    unsure = eqx.tree_at(lambda p: p.confidence, sure, np.full_like(sure.confidence, 0.3))
    assert word in (doubt(unsure, settings) or "")
    assert doubt(moving(12, without=tuple(range(12))), settings) is None  # that is another message


def test_black_recording_exits_with_1_and_advice(tmp_path):
    scene = make_scene(2)
    scene.silhouettes[:] = 0
    write_recording(tmp_path / "black.npz", scene)
    done = by_itself("run", "black.npz", "-o", "out", cwd=tmp_path)
    assert done.returncode == 1
    assert "2 empty" in done.stdout
    assert "no pose in any frame" in done.stderr
    assert (tmp_path / "out" / "poses.npz").exists()


@pytest.fixture(scope="module")
def sound(folder) -> dict[str, np.ndarray]:
    """Arrays of a sequence file of two frames."""
    write_recording(folder / "sound.npz", make_scene(2))
    with np.load(folder / "sound.npz") as file:
        return dict(file)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"K": None}, "K"),
        ({"R": np.zeros((8, 3, 3))}, "R"),
        ({"t": np.full((8, 3), 2500.0)}, "t"),
        ({"t": np.full((8, 3), np.nan)}, "t"),
        ({"t": np.zeros((7, 3))}, "t"),
        ({"size": np.array([320, 240])}, "silhouettes"),
        ({"fps": 0.0}, "fps"),
        ({"up": "Z"}, "up"),
    ],
)
@pytest.mark.parametrize("command", ["run", "check"])
def test_wrong_input_is_one_line_and_exit_code_2(tmp_path, sound, changes, key, command):
    broken = {name: value for name, value in (sound | changes).items() if value is not None}
    np.savez(tmp_path / "bad.npz", **broken)
    output = "out.png" if command == "check" else "out"
    done = jaxskel(command, "bad.npz", "-o", output, cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert f"bad.npz: key '{key}'" in done.stderr
    assert not (tmp_path / output).exists()


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 truncated", b"time,x,y\n0,1,2\n"])
def test_a_file_of_another_kind_is_one_line_and_exit_code_2(tmp_path, content):
    (tmp_path / "bad.npz").write_bytes(content)
    done = jaxskel("run", "bad.npz", "-o", "out", cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "bad.npz" in done.stderr
    assert not (tmp_path / "out").exists()


def test_output_that_is_a_file_is_refused_before_any_work(folder):
    (folder / "taken").write_text("mine")
    done = jaxskel("run", "scene.npz", "-o", "taken", cwd=folder)
    assert done.returncode == 2
    assert (folder / "taken").read_text() == "mine"


def test_help_and_version(tmp_path):
    assert "evaluate" in jaxskel("--help", cwd=tmp_path).stdout
    assert jaxskel("run", cwd=tmp_path).returncode == 2
    assert jaxskel("--version", cwd=tmp_path).stdout.startswith("jaxskel ")


@pytest.mark.slow
def test_compiled_code_is_kept_for_the_next_run_unless_told_not_to(folder, tmp_path):
    caches = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "HOME": str(tmp_path), "LOCALAPPDATA": str(tmp_path)}
    arguments = ("run", "scene.npz", "-o", tmp_path / "out", "--preset", "paper")
    # Hulls are compiled, too, and in less time than a pose.
    check = ("--no-cache", "check", "scene.npz", "-o", tmp_path / "check.png")
    without = by_itself(*check, cwd=folder, JAXSKEL_NO_CACHE="", **caches)
    assert without.returncode == 0, without.stderr
    assert not list(tmp_path.rglob("compiled"))
    first = by_itself(*arguments, cwd=folder, JAXSKEL_NO_CACHE="", **caches)
    assert first.returncode == 0, first.stderr
    kept = {file.name for file in tmp_path.rglob("compiled/*/*") if file.name.endswith("-cache")}
    assert kept
    second = by_itself(*arguments, cwd=folder, JAXSKEL_NO_CACHE="", **caches)
    assert second.returncode == 0, second.stderr
    assert {file.name for file in tmp_path.rglob("compiled/*/*") if file.name.endswith("-cache")} == kept


@pytest.mark.slow
def test_calibrate_body_writes_a_subject_and_says_so(tmp_path):
    recording, _ = film_person(other_person(), 10)
    write_recording(tmp_path / "measured.npz", recording)
    done = jaxskel("calibrate-body", "measured.npz", "-o", "subject.toml", "--max-misses", 0, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    last = done.stdout.strip().splitlines()[-1]
    assert last.startswith("subject.toml: 11 lengths of a subject of 1.")
    assert "judging" in done.stderr
    for name in ("upper_arm", "thigh", "± mm"):
        assert name in done.stdout
    body = read_body(tmp_path / "subject.toml")
    assert body is not None
    assert 1.6 < read_subject(tmp_path / "subject.toml").stature < 2.0


@pytest.mark.parametrize(
    ("options", "why"),
    [(("-o", "."), "must be a file"), (("--frames", 3), "8"), (("-o", "few.toml"), "8 or more")],
)
def test_calibrate_body_refuses_what_it_cannot_do(folder, options, why):
    # Six frames, of which one is empty, are too few.
    before = set(folder.iterdir())
    done = jaxskel("calibrate-body", "scene.npz", *options, cwd=folder)
    assert done.returncode == 2
    assert why in done.stderr
    assert set(folder.iterdir()) == before


def test_frames_that_go_through_no_stage_have_no_speed():
    times = StageTimes()
    with times("prepare"):
        pass
    times.end_of_batch(32)
    times.end_of_batch(1)
    assert str(times) == f"start-up {times.first['prepare']:.1f} s"
