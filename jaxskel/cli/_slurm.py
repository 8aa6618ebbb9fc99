"""`jaxskel batch --slurm`: runs the batch as an array of tasks on a cluster."""

import signal
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType
from typing import Any

from .._runtime.kept_programs import forget_compiled, keep_compiled
from ..batch import PROCESS_BYTES, Finished, Method, Progress, Shard, Source, finished_before, run_batch

FOLDER = ".slurm"
"""Subfolder of the output for submitit's files and the tasks' messages."""


@dataclass(frozen=True)
class Task:
    """A part of the batch, which submitit sends and a node runs.

    A restarted task has the same recordings, and skips those that are done.

    Attributes:
        kept: Whether compiled code is kept for the next run, in the node's own cache folder.
    """

    sources: list[Source]
    output: Path
    method: Method
    jobs: int
    request: str
    timeout: float
    kept: bool

    def __call__(self) -> dict[str, str]:
        """Process the recordings; return the result of each."""
        if self.kept:
            keep_compiled()
        # Otherwise submitit ignores the signal, and Slurm starts the task again while this one still runs.
        stop_when_told()
        count = 0

        def tell(event: Progress | Finished) -> None:
            nonlocal count
            if isinstance(event, Finished):
                count += 1
                print(event.told(count, len(self.sources)), flush=True)

        found = run_batch(self.sources, self.output, self.method, self.jobs, self.request, tell, timeout=self.timeout)
        return {name: str(manifest.outcome) for name, manifest in (found.before | found.now).items()}

    def checkpoint(self) -> Any:
        """Requeue the task near its time limit, or when it is preempted."""
        from submitit.helpers import DelayedSubmission

        return DelayedSubmission(self)


def stop_when_told() -> None:
    """Make a scheduler's signal end the process as an interrupt from the keyboard does."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, stop)


def submit(
    sources: Sequence[Source],
    output: Path,
    method: Method,
    jobs: int,
    request: str,
    timeout: float,
    tasks: int,
    minutes: int,
    options: Sequence[str],
) -> str:
    """Submit the recordings that are not done as an array of tasks, and describe it.

    Raises:
        ValueError: submitit or Slurm is missing, or an option is invalid.
    """
    left = [source for source in sources if finished_before(source, output, method, request) is None]
    if not left:
        return f"{output}: {len(sources)} recordings, all done before"
    try:
        import submitit
    except ImportError:
        raise ValueError('--slurm needs submitit: python -m pip install "jaxskel[slurm]"') from None
    pairs = [option.partition("=") for option in options]
    if not all(key and sign for key, sign, _ in pairs):
        raise ValueError(f"--slurm-option {' '.join(options)}: give KEY=VALUE, such as partition=long")
    count = min(tasks, len(left))
    # The node may start in another folder.
    left = [_absolute(source) for source in left]
    method = replace(method, subject=None if method.subject is None else method.subject.absolute())
    kept = forget_compiled()
    given = [
        Task(Shard(number + 1, count).part(left), output.absolute(), method, jobs, request, timeout, kept)
        for number in range(count)
    ]
    try:
        executor = submitit.AutoExecutor(output / FOLDER, cluster="slurm", slurm_python=sys.executable)
    except RuntimeError as error:
        raise ValueError(f"--slurm: {error}; run it on a machine of the cluster") from None
    executor.update_parameters(
        name="jaxskel", timeout_min=minutes, cpus_per_task=jobs, mem_gb=(PROCESS_BYTES >> 30) * jobs,
        slurm_additional_parameters={"requeue": True} | {key: value for key, _, value in pairs},
    )  # fmt: skip
    with executor.batch():
        sent = [executor.submit(task) for task in given]
    job = sent[0].job_id.partition("_")[0]
    return (
        f"{output}: {len(left)} of {len(sources)} recordings in {count} tasks of Slurm job {job}; "
        f"their messages are in {output / FOLDER}; jaxskel summary {output} lists the results"
    )


def _absolute(source: Source) -> Source:
    listed_in = None if source.listed_in is None else source.listed_in.absolute()
    return replace(source, path=source.path.absolute(), listed_in=listed_in)
