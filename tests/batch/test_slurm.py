"""The tests' Slurm works: it runs arrays, two tasks at once, and restarts requeued tasks.

It does so with jobs from submitit as well.
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import submitit
from support.command_line import jaxskel
from support.slurm_node import SlurmNode, reason_to_skip, running, until
from support.slurm_tasks import square, wait_for_go

from jaxskel.batch import read_results
from jaxskel.io.recordings import write_recording
from jaxskel.synthetic import camera_ring, make_scene

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(reason_to_skip()), reason=str(reason_to_skip())),
]


@pytest.fixture(scope="module")
def slurm(tmp_path_factory) -> Iterator[SlurmNode]:
    with running(tmp_path_factory.mktemp("slurm")) as node:
        yield node


def script(folder: Path, *lines: str) -> Path:
    file = folder / "job.sh"
    file.write_text("\n".join(["#!/bin/bash", f"#SBATCH --output={folder}/%A_%a.out", f"cd {folder}", *lines]))
    return file


def test_an_array_runs_every_task_once(slurm, tmp_path):
    slurm.submit(script(tmp_path, "echo $SLURM_ARRAY_TASK_ID >> tasks"), "--array=0-3")
    slurm.wait_until_empty()
    assert sorted((tmp_path / "tasks").read_text().split()) == ["0", "1", "2", "3"]


def test_two_tasks_run_at_once(slurm, tmp_path):
    # Each waits for the other, so they would never end if they ran one after the other.
    meet = "touch here.$SLURM_ARRAY_TASK_ID; until [ -e here.0 ] && [ -e here.1 ]; do sleep 0.05; done; echo met >> met"
    slurm.submit(script(tmp_path, meet), "--array=0-1")
    slurm.wait_until_empty()
    assert (tmp_path / "met").read_text() == "met\nmet\n"


def test_a_requeued_task_runs_again(slurm, tmp_path):
    line = "echo $SLURM_ARRAY_TASK_ID ${SLURM_RESTART_COUNT:-0} >> runs; until [ -e go ]; do sleep 0.05; done"
    job = slurm.submit(script(tmp_path, line), "--array=0-1", "--requeue")
    runs = tmp_path / "runs"
    until(lambda: runs.exists() and len(runs.read_text().splitlines()) == 2, "two tasks")
    slurm.requeue(f"{job}_1")
    until(lambda: len(runs.read_text().splitlines()) == 3, "the second run")
    (tmp_path / "go").touch()
    slurm.wait_until_empty()
    assert sorted(runs.read_text().splitlines()) == ["0 0", "1 0", "1 1"]


@pytest.fixture
def executor(slurm, tmp_path, monkeypatch) -> submitit.AutoExecutor:
    """Submitit as a user of the cluster has it; jobs import functions from the tests."""
    for name, value in slurm.environment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1]), prepend=os.pathsep)
    sent = submitit.AutoExecutor(tmp_path / "submitit", cluster="slurm")
    sent.update_parameters(timeout_min=60, cpus_per_task=1, mem_gb=1)
    return sent


def test_submitit_brings_results_back_in_their_order(executor):
    assert [job.result() for job in executor.map_array(square, [3, 1, 2])] == [9, 1, 4]


def test_submitit_runs_no_more_tasks_at_once_than_asked_for(slurm, executor, tmp_path):
    executor.update_parameters(slurm_array_parallelism=1)
    log = tmp_path / "log"
    jobs = executor.map_array(wait_for_go, [log, log])
    until(log.exists, "the first task")
    # Half of the node is free, and Slurm says what the second task waits for.
    waiting = ("squeue", "--noheader", "--array", "--states=PENDING", "--format=%r", f"--jobs={jobs[1].job_id}")
    until(lambda: slurm.run(*waiting) == "JobArrayTaskLimit", "the second task to wait for the first")
    assert log.read_text() == "0 0\n"
    (tmp_path / "go").touch()
    assert [job.result() for job in jobs] == [0, 0]


def test_a_requeued_task_of_submitit_runs_again_with_its_arguments(slurm, executor, tmp_path):
    log = tmp_path / "log"
    jobs = executor.map_array(wait_for_go, [log, log])
    until(lambda: log.exists() and len(log.read_text().splitlines()) == 2, "two tasks")
    slurm.requeue(jobs[1].job_id)
    until(lambda: len(log.read_text().splitlines()) == 3, "the second run")
    (tmp_path / "go").touch()
    assert [job.result() for job in jobs] == [0, 1]
    assert sorted(log.read_text().splitlines()) == ["0 0", "1 0", "1 1"]


def test_nothing_runs_on_when_a_test_fails(tmp_path):
    deaf = script(tmp_path, "trap '' TERM", "setsid sleep 1000 &", "echo $$ $! > new; mv new started", "sleep 1000")

    def fail_while_it_runs() -> None:
        with running(tmp_path) as node:
            node.submit(deaf)
            until((tmp_path / "started").exists, "the job")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_while_it_runs()
    pids = [*(tmp_path / "started").read_text().split(), *(file.read_text().strip() for file in tmp_path.glob("*.pid"))]
    assert len(pids) == 5  # the script, a process that left its process group, and three daemons
    commands = [Path(f"/proc/{pid}/cmdline") for pid in pids]
    assert not [file for file in commands if file.exists() and file.read_bytes()]  # a zombie has none


def test_a_batch_of_a_dozen_as_an_array_with_a_task_killed_and_put_back(slurm, tmp_path):
    """All recordings are done, each once."""
    scene = make_scene(2, cameras=camera_ring(4, size=(160, 120)))
    for number in range(12):
        write_recording(tmp_path / "data" / f"walk{number:02d}.npz", scene)
    out = tmp_path / "out"
    start = [sys.executable, "-c", "from jaxskel.cli import main; main()"]
    command = ["batch", "data", "-o", "out", "--preset", "paper", "--slurm", "3"]
    sent = subprocess.run(
        [*start, *command], cwd=tmp_path, env=slurm.environment, capture_output=True, text=True, timeout=120
    )
    assert sent.returncode == 0, sent.stderr
    job = re.fullmatch(r"out: 12 of 12 recordings in 3 tasks of Slurm job (\d+); .*\n", sent.stdout)[1]
    # The third recording is walk02: that task has begun, and is not at its end.
    told = out / ".slurm" / f"{job}_2_0_log.out"
    until(lambda: told.exists() and "walk02: 2 frames" in told.read_text(), "a recording of the third task", 300)
    slurm.kill(f"{job}_2")
    slurm.wait_until(f"{job}_2", "FAILED")
    before = {path.parent.name: path.read_bytes() for path in out.glob("*/manifest.json")}
    assert 1 <= len(before) < 12
    slurm.requeue(f"{job}_2")
    slurm.wait_until_empty(600)
    found = read_results(out)
    assert sorted(found) == [f"walk{number:02d}" for number in range(12)], slurm.log()
    assert all(manifest.frames == 2 for manifest in found.values())
    assert all((out / name / "manifest.json").read_bytes() == content for name, content in before.items())
    said = "".join(path.read_text() for path in (out / ".slurm").glob("*_log.out"))
    assert sorted(re.findall(r"\] (walk\d\d): 2 frames", said)) == sorted(found)
    again = jaxskel(*command, cwd=tmp_path)
    assert again.stdout == "out: 12 recordings, all done before\n"
