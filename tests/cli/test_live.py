"""`jaxskel live` writes every pose, however it ends, and never over poses that are there."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from support.capture_rigs import write_rig
from support.command_line import jaxskel
from support.live_sessions import StubStream, numbered, step_of
from support.poses import moving

from jaxskel.io.poses import JOURNAL_FILE, PosesJournal, read_poses, write_poses
from jaxskel.io.recordings import write_recording

# The command with poses that cost nothing; each frame is told as it is handed to the command.
STUBBED = """
import sys
from unittest.mock import patch
from support.live_sessions import StubStream
from jaxskel.cli._app import main

class Telling(StubStream):
    def push(self, masks, *rest):
        print("frame", self.count, flush=True)
        return super().push(masks)

with patch("jaxskel.cli._live.Stream", Telling), patch("jaxskel.cli._live.warm_up"):
    main()
"""


@pytest.fixture
def scene(tmp_path) -> Path:
    write_recording(tmp_path / "scene.npz", numbered(10))
    return tmp_path / "scene.npz"


def live(*arguments: object, cwd: Path) -> subprocess.CompletedProcess:
    with patch("jaxskel.cli._live.Stream", StubStream), patch("jaxskel.cli._live.warm_up"):
        return jaxskel("live", *arguments, cwd=cwd)


def started(*arguments: object, cwd: Path) -> subprocess.Popen:
    known = os.environ | {"JAXSKEL_NO_CACHE": "1", "PYTHONPATH": str(Path(__file__).parents[1])}
    command = [sys.executable, "-c", STUBBED, "live", *map(str, arguments)]
    return subprocess.Popen(
        command, cwd=cwd, env=known, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=1
    )


def wait_for_frame(session: subprocess.Popen, number: int) -> None:
    assert session.stdout is not None
    for line in session.stdout:
        if line == f"frame {number}\n":
            return
    raise AssertionError(session.stderr.read())


def test_a_session_writes_what_run_writes(scene, tmp_path):
    done = live(scene, "-o", "out", "--loop", "--seconds", 0.6, "--no-page", cwd=tmp_path)
    assert done.returncode == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["poses.csv", "poses.npz"]
    poses = read_poses(tmp_path / "out" / "poses.npz")
    assert poses.frame_index.tolist() == list(range(15))
    assert poses.fps == 25.0
    there = np.flatnonzero(poses.has_pose)
    np.testing.assert_array_equal(poses.joints[there], StubStream(None).walk.joints[: len(there)])
    dropped = 15 - len(there)
    assert f"out/poses.npz, out/poses.csv: 15 frames, {len(there)} with a pose, {dropped} without" in done.stdout
    assert f"{dropped} dropped" in done.stdout
    assert "latency" in done.stdout


def test_cameras_are_read_cut_out_and_written(tmp_path):
    write_rig(tmp_path / "rig")
    done = live("rig", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0
    assert "http://127.0.0.1:" in done.stdout
    assert len(read_poses(tmp_path / "out" / "poses.npz")) >= 6
    refused = live("rig", "-o", "other", "--loop", cwd=tmp_path)
    assert refused.returncode == 2
    assert "leave out --fps and --loop" in refused.stderr


def test_an_avatar_gets_every_pose(scene, tmp_path):
    pytest.importorskip("pythonosc", reason='needs python-osc: pip install "jaxskel[live]"')
    from support.avatar import Avatar

    avatar = Avatar()
    try:
        done = live(scene, "-o", "out", "--no-page", "--osc", f"127.0.0.1:{avatar.port}", cwd=tmp_path)
        assert done.returncode == 0
        poses = read_poses(tmp_path / "out" / "poses.npz")
        avatar.wait(int(poses.has_pose.sum()))
    finally:
        avatar.close()
    hips = [values for name, *values in avatar.of("/VMC/Ext/Bone/Pos") if name == "Hips"]
    wanted = poses.joints[poses.has_pose, 0][:, [1, 2, 0]] * [-1, 1, 1]
    np.testing.assert_allclose([values[:3] for values in hips], wanted, atol=1e-5)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_everything_written(scene, tmp_path, number):
    session = started(scene, "-o", "out", "--loop", "--no-page", cwd=tmp_path)
    wait_for_frame(session, 9)
    session.send_signal(number)
    out, err = session.communicate(timeout=60)
    assert session.returncode == 130, err
    told = [line for line in out.splitlines() if line.startswith("frame ")]
    poses = read_poses(tmp_path / "out" / "poses.npz")
    assert poses.has_pose.sum() == 10 + len(told)
    assert out.splitlines()[-1].startswith("out/poses.npz, out/poses.csv: ")


def test_killed_in_the_middle_it_loses_nothing_that_was_done(scene, tmp_path):
    session = started(scene, "-o", "out", "--loop", "--no-page", cwd=tmp_path)
    wait_for_frame(session, 20)
    session.kill()
    out, _ = session.communicate(timeout=60)
    done = 20 + len([line for line in out.splitlines() if line.startswith("frame ")])
    journal = tmp_path / "out" / JOURNAL_FILE
    assert [path.name for path in (tmp_path / "out").iterdir()] == [JOURNAL_FILE]
    found = read_poses(journal)
    assert int(found.has_pose.sum()) in (done, done + 1)
    np.testing.assert_array_equal(found.joints[found.has_pose][:20], StubStream(None).walk.joints[:20])

    again = live(scene, "-o", "out", "--no-page", cwd=tmp_path)
    assert again.returncode == 2
    assert "`jaxskel export out/poses.live out/poses.npz` makes poses of it" in again.stderr
    before = journal.read_bytes()
    assert jaxskel("export", "out/poses.live", "out/poses.npz", cwd=tmp_path).returncode == 0
    np.testing.assert_array_equal(read_poses(tmp_path / "out" / "poses.npz").joints, found.joints)
    assert journal.read_bytes() == before


def test_a_source_that_fails_leaves_what_came_before(scene, tmp_path):
    class Failing(StubStream):
        def push(self, masks, *rest):
            if self.count == 4:
                raise ValueError("cam2.avi: breaks off at frame 4; write it again")
            return super().push(masks)

    with patch("jaxskel.cli._live.Stream", Failing), patch("jaxskel.cli._live.warm_up"):
        done = jaxskel("live", scene, "-o", "out", "--no-page", cwd=tmp_path)
    assert done.returncode == 2
    assert "breaks off at frame 4" in done.stderr
    assert read_poses(tmp_path / "out" / "poses.npz").has_pose.sum() == 4


def test_poses_that_are_there_are_not_replaced(scene, tmp_path):
    write_poses(tmp_path / "out", moving(3))
    before = (tmp_path / "out" / "poses.npz").read_bytes()
    done = live(scene, "-o", "out", "--no-page", cwd=tmp_path)
    assert done.returncode == 2
    assert "out/poses.npz: exists already; choose another output for a new session" in done.stderr
    assert (tmp_path / "out" / "poses.npz").read_bytes() == before


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--osc", "127.0.0.1:x"], "--osc 127.0.0.1:x: give HOST or HOST:PORT"),
        (["--osc", ":39539"], "--osc :39539: give HOST or HOST:PORT"),
        (["--port", "70000"], "--port 70000: give a port"),
        (["--fps", "0"], "--fps 0: give frames per second"),
        (["--seconds", "nan"], "--seconds nan: give a time in seconds"),
    ],
)
def test_options_that_make_no_sense_are_named(scene, tmp_path, options, told):
    done = live(scene, "-o", "out", *options, cwd=tmp_path)
    assert done.returncode == 2
    assert told in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_missing_extra_is_named(scene, tmp_path, monkeypatch):
    for module, options in (
        ("websockets.sync.server", []),
        ("pythonosc.osc_bundle_builder", ["--no-page", "--osc", "localhost"]),
    ):
        monkeypatch.setitem(sys.modules, module, None)
        done = live(scene, "-o", "out", *options, cwd=tmp_path)
        assert done.returncode == 2
        assert 'pip install "jaxskel[live]"' in done.stderr
        assert not (tmp_path / "out").exists()


def test_a_report_and_an_export_read_a_journal_that_is_being_written(tmp_path, scene):
    poses = moving(10)
    journal = PosesJournal(tmp_path / JOURNAL_FILE, 25.0, "+Z")
    for row in range(4):
        journal.append(step_of(poses, row))
    start = time.monotonic()
    done = jaxskel("export", JOURNAL_FILE, "walk.csv", "walk.bvh", cwd=tmp_path)
    journal.close()
    assert done.returncode == 0
    assert time.monotonic() - start < 60
    assert len((tmp_path / "walk.csv").read_text().splitlines()) == 5
