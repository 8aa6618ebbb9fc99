"""The Slurm of the tests is a Slurm: it runs arrays, two tasks at once, and starts again what is requeued."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from slurm_node import SlurmNode, reason_to_skip, running, until

pytestmark = pytest.mark.skipif(bool(reason_to_skip()), reason=str(reason_to_skip()))


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
    # Each waits for the other: one after the other, they would never end.
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


def test_nothing_runs_on_when_a_test_fails(tmp_path):
    deaf = script(tmp_path, "trap '' TERM", "setsid sleep 1000 &", "echo $$ $! > new; mv new started", "sleep 1000")

    def fail_while_it_runs() -> None:
        with running(tmp_path) as node:
            node.submit(deaf)
            until((tmp_path / "started").exists, "the job")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_while_it_runs()
    batch, detached = (Path("/proc") / number / "cmdline" for number in (tmp_path / "started").read_text().split())
    assert not (batch.exists() and batch.read_bytes())  # one that has ended, but was not asked for yet, has none
    assert not (detached.exists() and detached.read_bytes())
    assert not SlurmNode(tmp_path).is_idle()
