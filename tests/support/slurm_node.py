"""A real Slurm of one node with two processors, on loopback and in a folder of its own.

Controller, node daemon and munge are started as they are on a cluster, only without cgroups, accounting and systemd.
"""

import os
import re
import secrets
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "setpriv")
CONFIGURATION = """
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket={folder}/munge.socket
SlurmctldPort={controller_port}
SlurmdPort={node_port}
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
MailProg=/bin/true
MpiDefault=none
ProctrackType=proctrack/pgid
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
# The queue is looked at ten times a second, not twice a minute.
SchedulerType=sched/builtin
SchedulerParameters=batch_sched_delay=0,sched_interval=1,sched_min_interval=100000
JobRequeue=1
KillWait=2
MinJobAge=600
ReturnToService=2
NodeName=node NodeHostname={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=4000
PartitionName=all Nodes=node Default=YES DefMemPerCPU=1000 State=UP
"""


def reason_to_skip() -> str | None:
    """The reason why Slurm cannot be started here; None if it can."""
    path = f"{os.environ['PATH']}:/usr/sbin:/sbin"  # daemons are not on the path of every shell
    missing = [program for program in PROGRAMS if not shutil.which(program, path=path)]
    if missing:
        return f"needs {', '.join(missing)}: apt-get install slurm-wlm munge"
    return None if os.geteuid() == 0 else "needs root: Slurm's node daemon runs as root"


def until(holds: Callable[[], object], what: str, seconds: float = 60) -> None:
    """Wait for a condition; fail with a message if it does not hold in time."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, f"{what}: not within {seconds} s"
        time.sleep(0.05)


class SlurmNode:
    """The node as tests use it; a command needs `environment` to find it."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.environment = {
            **{name: value for name, value in os.environ.items() if not re.match("SLURM|SBATCH|SRUN", name)},
            "PATH": f"{os.environ['PATH']}:/usr/sbin:/sbin",
            "SLURM_CONF": str(folder / "slurm.conf"),
        }

    def run(self, *command: object) -> str:
        """Run a command and return its output; if it fails, the error has its message."""
        done = subprocess.run([*map(str, command)], env=self.environment, capture_output=True, text=True, timeout=60)
        assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}{self.log()}"
        return done.stdout.strip()

    def log(self) -> str:
        """The end of the daemons' logs."""
        return "\n".join(f"{file}:\n{file.read_text()[-6000:]}" for file in sorted(self.folder.glob("*.log")))

    def submit(self, script: Path, *options: object) -> str:
        """Submit a script; return the job's number."""
        return self.run("sbatch", "--parsable", *options, script)

    def states(self, job: str) -> set[str]:
        """States of a job or of an array's tasks, ended ones too."""
        return set(self.run("squeue", "--noheader", "--array", "--states=all", "--format=%T", f"--jobs={job}").split())

    def is_idle(self) -> bool:
        """Whether the controller answers and the node waits for work."""
        command = ["sinfo", "--noheader", "--format=%T"]
        return subprocess.run(command, env=self.environment, capture_output=True, text=True).stdout.strip() == "idle"

    def wait_until_empty(self, seconds: float = 120) -> None:
        """Wait until no job runs or waits."""
        until(lambda: not self.run("squeue", "--noheader") and self.is_idle(), f"an empty queue{self.log()}", seconds)

    def wait_until(self, job: str, state: str, seconds: float = 60) -> None:
        """Wait until a job, or every given task, is in a state such as `RUNNING`."""
        until(lambda: self.states(job) == {state}, f"{job} {state}{self.log()}", seconds)

    def requeue(self, job: str) -> None:
        """Requeue a job or an array's task, and restart it soon: by default a requeued job waits two minutes."""
        self.run("scontrol", "requeue", job)
        self.start_soon(job)

    def start_soon(self, job: str) -> None:
        """Do not let a requeued job wait for long.

        But do not start it at once: if it reaches the node within the second in which it ended, the node takes it for
        a part of the ended run, and the controller ends the job for good.
        """
        self.wait_until(job, "PENDING")
        self.run("scontrol", "update", f"JobId={job}", "StartTime=now+3seconds")

    def kill(self, job: str) -> None:
        """Kill all processes of an array's task: its script and what that started."""
        array, _, task = job.partition("_")
        marks = [f"SLURM_ARRAY_JOB_ID={array}\0".encode(), f"SLURM_ARRAY_TASK_ID={task}\0".encode()]
        found = [number for number in self.processes() if all(mark in _environment(number) for mark in marks)]
        assert found, f"{job} has no process"
        for number in found:
            with suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)

    def processes(self) -> list[int]:
        """All processes that this Slurm has started, daemons and those that left their process group too."""
        own = f"SLURM_CONF={self.environment['SLURM_CONF']}\0".encode()
        return [number for number in map(int, filter(str.isdigit, os.listdir("/proc"))) if own in _environment(number)]


def _environment(process: int) -> bytes:
    """The environment of a process; the tests' own does not name the node."""
    try:
        return Path(f"/proc/{process}/environ").read_bytes() + b"\0"
    except OSError:  # it has just ended
        return b""


@contextmanager
def running(folder: Path) -> Iterator[SlurmNode]:
    """A node that takes jobs; all its processes are ended afterwards, even after an error."""
    node = SlurmNode(folder)
    with socket.create_server(("127.0.0.1", 0)) as first, socket.create_server(("127.0.0.1", 0)) as second:
        ports = {"controller_port": first.getsockname()[1], "node_port": second.getsockname()[1]}
    for name in ("state", "spool"):
        (folder / name).mkdir()
    host = socket.gethostname().split(".")[0]
    (folder / "slurm.conf").write_text(CONFIGURATION.format(folder=folder, host=host, **ports))
    (folder / "munge.key").touch(0o600)
    (folder / "munge.key").write_bytes(secrets.token_bytes(1024))
    daemons: list[subprocess.Popen] = []

    def start(*command: str) -> None:
        with (folder / f"{command[0]}.log").open("w") as log:
            # If the tests are killed, the daemons are killed too.
            bound = ["setpriv", "--pdeathsig", "KILL", *command]
            daemons.append(subprocess.Popen(bound, env=node.environment, stdout=log, stderr=log, cwd=folder))

    def until_started(holds: Callable[[], bool]) -> None:
        def holds_or_ended() -> bool:
            assert all(daemon.poll() is None for daemon in daemons), f"a daemon has ended\n{node.log()}"
            return holds()

        until(holds_or_ended, "Slurm's start")

    try:
        munge = {"socket": "socket", "key-file": "key", "pid-file": "pid", "seed-file": "seed", "log-file": "own.log"}
        files = [f"--{option}={folder}/munge.{end}" for option, end in munge.items()]
        start("munged", "--foreground", "--force", *files)
        until_started((folder / "munge.socket").exists)
        start("slurmctld", "-D")
        start("slurmd", "-D", "-N", "node")
        until_started(node.is_idle)
        yield node
    finally:
        # Asked to end, daemons first wait for their jobs; there is nothing to keep here.
        while left := node.processes():
            for process in left:
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
            for daemon in daemons:
                daemon.poll()  # one that has ended stays in the table until it is asked for
            time.sleep(0.02)
        for daemon in daemons:
            daemon.wait()
