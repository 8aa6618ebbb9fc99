"""Many recordings in separate processes, as from the command line: failures, killed processes, resumed work."""

import csv
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.command_line import jaxskel

from jaxskel import paper_settings
from jaxskel._runtime.worker_processes import signals_ignored
from jaxskel.batch import Finished, Method, Outcome, Progress, Source, read_results
from jaxskel.batch._manifest import read_manifest
from jaxskel.batch._workers import work_on
from jaxskel.io.poses import read_poses
from jaxskel.io.recordings import write_recording
from jaxskel.synthetic import camera_ring, make_scene

pytestmark = pytest.mark.slow

FRAMES = 40  # two batches
NAMES = ("walk0", "walk1", "walk2", "walk3")


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    """Four good recordings and five broken ones, each in a different way."""
    data = tmp_path_factory.mktemp("data")
    scene = make_scene(FRAMES, cameras=camera_ring(4, size=(160, 120)))
    for i, name in enumerate(NAMES):
        write_recording(data / f"{name}.npz", scene[i:])
    whole = (data / "walk0.npz").read_bytes()
    (data / "cut.npz").write_bytes(whole[: len(whole) // 2])
    (data / "text.npz").write_text("no archive")
    np.savez(data / "lone.npz", silhouettes=scene.silhouettes)
    scene.silhouettes[:] = 0
    write_recording(data / "black.npz", scene)
    (data / "folder").mkdir()
    (data / "folder/recording.toml").write_text("fps = 30.0\n")
    return data


@pytest.fixture(scope="module")
def compiled(tmp_path_factory) -> dict[str, str]:
    """A shared cache of compiled code for all processes, without checks of shapes."""
    given = os.environ.get("JAX_COMPILATION_CACHE_DIR") or str(tmp_path_factory.mktemp("compiled"))
    return os.environ | {"JAX_COMPILATION_CACHE_DIR": given}


def command(data: Path, out: Path, *more: str) -> list[str]:
    start = [sys.executable, "-c", "from jaxskel.cli import main; main()", "batch", str(data), "-o", str(out)]
    return [*start, "--preset", "paper", *more]


def batch(data: Path, out: Path, compiled: dict[str, str], *more: str) -> subprocess.CompletedProcess:
    return subprocess.run(command(data, out, *more), env=compiled, capture_output=True, text=True, timeout=600)


@pytest.fixture(scope="module")
def ran(data, compiled, tmp_path_factory) -> tuple[Path, subprocess.CompletedProcess]:
    out = tmp_path_factory.mktemp("out")
    return out, batch(data, out, compiled, "--jobs", "2")


def test_what_breaks_is_told_and_the_others_are_done(ran):
    out, done = ran
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    last = done.stdout.splitlines()[-1]
    assert last.startswith(f"{out}: 9 recordings, 4 done (0 of them before), 1 without a pose, 4 failed; ")
    found = read_results(out)
    assert {name for name, each in found.items() if each.outcome is Outcome.DONE} == set(NAMES)
    assert found["black"].outcome is Outcome.NO_POSE
    for name in ("cut", "text", "lone", "folder"):
        assert found[name].outcome is Outcome.FAILED
        assert f"{name}" in str(found[name].problem)
        assert f"] {name}: failed: " in done.stderr
        assert not (out / name).exists()
    for i, name in enumerate(NAMES):
        assert len(read_poses(out / name / "poses.npz")) == found[name].frames == FRAMES - i
        assert found[name].seconds.keys() >= {"read", "prepare", "reconstruct"}


def test_the_summary_is_a_table_of_all(ran):
    out, _ = ran
    done = jaxskel("summary", out, cwd=out.parent)
    assert done.returncode == 0
    posed = {name: int(read_poses(out / name / "poses.npz").has_pose.sum()) for name in NAMES}
    counts = f"9 recordings (4 done, 1 no pose, 4 failed), {5 * FRAMES - 6} frames, {sum(posed.values())} with a pose"
    assert done.stdout.splitlines()[-1] == f"{out / 'summary.csv'}: {counts}"
    with open(out / "summary.csv", newline="") as file:
        rows = {row["name"]: row for row in csv.DictReader(file)}
    assert {name: int(rows[name]["with_pose"]) for name in NAMES} == posed
    assert float(rows["walk1"]["fps"]) > 0
    assert rows["cut"]["outcome"] == "failed"
    assert "cut.npz" in rows["cut"]["problem"]


def test_killed_and_run_again_the_poses_are_the_same_and_nothing_is_done_twice(ran, data, compiled, tmp_path):
    reference, _ = ran
    done: dict[str, bytes] = {}
    for moment in (4.0, 6.0):  # s
        with subprocess.Popen(command(data, tmp_path, "--jobs", "2"), env=compiled, stderr=subprocess.DEVNULL) as run:
            time.sleep(moment)
            run.send_signal(signal.SIGKILL)
        for path in tmp_path.glob("*/manifest.json"):
            assert done.setdefault(path.parent.name, path.read_bytes()) == path.read_bytes()
            assert read_poses(path.parent / "poses.npz").joints.shape[1:] == (15, 3)
    last = batch(data, tmp_path, compiled, "--jobs", "2")
    assert last.returncode == 1
    assert f"4 done ({len(done) - ('black' in done)} of them before)" in last.stdout.splitlines()[-1] or "black" in done
    for name in (*NAMES, "black"):
        assert (tmp_path / name / "poses.npz").read_bytes() == (reference / name / "poses.npz").read_bytes()
        if name in done:
            assert (tmp_path / name / "manifest.json").read_bytes() == done[name]
    assert not list(tmp_path.glob(".*.part"))


def test_ended_by_a_scheduler_or_a_person_it_says_how_to_go_on(data, compiled, tmp_path):
    for number in (signal.SIGTERM, signal.SIGINT):
        with subprocess.Popen(
            command(data, tmp_path), env=compiled, stderr=subprocess.PIPE, text=True, start_new_session=True
        ) as run:
            assert run.stderr is not None
            told = run.stderr.readline()  # the first recording is done
            os.killpg(run.pid, number)
            told += run.stderr.read()
        assert run.returncode == 130
        assert "interrupted; the same command goes on from here" in told
        assert "Traceback" not in told


def test_a_signal_that_another_thread_takes_waits_for_the_start_of_a_process():
    go, over = threading.Event(), []
    other = threading.Thread(target=lambda: (go.wait(), signal.raise_signal(signal.SIGINT)))
    other.start()

    def start() -> None:
        with signals_ignored():
            go.set()
            other.join()
            over.append(True)

    with pytest.raises(KeyboardInterrupt):
        start()
    assert over == [True]


DEAF = """
import os, pickle, signal
from jaxskel._runtime.worker_processes import WorkerProcess

workers = [WorkerProcess(core, pickle.dumps(print)) for core in range(2)]
for worker in workers:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        os.kill(worker.process.pid, number)
    worker.process.join(0.5)  # so early that nothing of ours can run yet
    print(worker.process.exitcode)
    worker.end()
"""


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="no masks of signals on this system")
def test_processes_take_no_notice_of_signals_from_their_very_beginning():
    """In a separate process: multiprocessing's first process starts a helper, which once unblocked the signals."""
    run = subprocess.run([sys.executable, "-c", DEAF], capture_output=True, text=True, timeout=100)
    assert (run.stdout.split(), run.stderr) == (["None", "None"], "")


def test_a_process_that_dies_harms_its_own_recording_only(data, tmp_path):
    """The first process is killed after its first message, as the system does when memory is short."""
    sources = [Source(name, data / f"{name}.npz") for name in ("walk0", "black", "text")]
    killed = None
    found = {}
    for event in work_on(sources, tmp_path, Method(paper_settings()), 1):
        if killed is None and isinstance(event, Progress):
            (process,) = multiprocessing.active_children()
            os.kill(process.pid or 0, signal.SIGKILL)
            killed = event.source.name
        if isinstance(event, Finished):
            found[event.source.name] = event.manifest
    assert killed == "walk0"
    assert found["walk0"].outcome is Outcome.FAILED
    assert "walk0.npz: its process was killed (signal 9), perhaps out of memory" in str(found["walk0"].problem)
    assert found["black"].outcome is Outcome.NO_POSE
    assert found["text"].outcome is Outcome.FAILED
    assert read_results(tmp_path) == found


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--shard", "3"], "--shard 3: give the number of the part and how many there are, such as 1/4"),
        (["--shard", "5/4"], "shard 5/4: give 1/n to n/n"),
        (["--track"], "--track: the paper's method treats each frame by itself"),
        (["--subject", "gone.toml"], "gone.toml: cannot be opened"),
    ],
)
def test_refused_before_any_work(data, tmp_path, more, told):
    done = jaxskel("batch", data, "-o", "out", "--preset", "paper", *more, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"jaxskel: {told}")
    assert not (tmp_path / "out").exists()


@settings(deadline=None, max_examples=100)
@given(where=st.floats(0, 0.999), byte=st.integers(0, 255), cut=st.booleans())
def test_damaged_manifests_are_read_or_refused_by_name(ran, where, byte, cut):
    out, _ = ran
    content = bytearray((out / "walk0" / "manifest.json").read_bytes())
    place = int(where * len(content))
    content[place:] = b"" if cut else bytes([byte]) + content[place + 1 :]
    path = out / "damaged.json"
    path.write_bytes(content)
    told = f"{path}: "
    try:
        read_manifest(path)
    except ValueError as error:
        told = str(error)
    assert told.startswith(f"{path}: ")
