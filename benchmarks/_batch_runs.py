"""Starts `jaxskel batch` as users do, and makes recordings for it."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import jax
import numpy as np

from jaxskel import default_adult
from jaxskel.io.recordings import write_recording
from jaxskel.synthetic import camera_ring, demo_motion, make_scene

_MOTION = 64  # length (frames) of the motion that recordings are cut from


def film(folder: Path, count: int, frames: int, size: tuple[int, int] = (320, 240)) -> list[Path]:
    """Write short recordings of people of all statures, filmed by six to eight cameras."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for number in range(count):
        random = np.random.default_rng(number)
        path = folder / f"walk{number:03d}.npz"
        paths.append(path)
        if path.exists():
            continue
        skeleton = default_adult(float(random.uniform(1.5, 1.95)))
        first = int(random.integers(0, _MOTION - frames))
        motion = demo_motion(skeleton, _MOTION, 5.0)
        motion = jax.tree.map(lambda a, first=first: a[first : first + frames], motion)
        cameras = camera_ring(6 + number % 3, size=size)
        write_recording(path, make_scene(cameras=cameras, skeleton=skeleton, motion=motion))
    return paths


def break_some(paths: list[Path]) -> list[str]:
    """Break five recordings, each in a different way; return their names."""
    cut, empty, text, black, lone = paths[:: len(paths) // 5][:5]
    cut.write_bytes(cut.read_bytes()[:9000])
    empty.write_bytes(b"")
    text.write_text("not an archive")
    with np.load(black) as arrays:
        np.savez_compressed(black, **{k: np.zeros_like(a) if k == "silhouettes" else a for k, a in arrays.items()})
    with np.load(lone) as arrays:
        np.savez_compressed(lone, **{k: a for k, a in arrays.items() if k != "R"})
    return [path.stem for path in (cut, empty, text, black, lone)]


def command(inputs: Path, output: Path, *more: str) -> list[str]:
    """The command line."""
    start = [sys.executable, "-c", "from jaxskel.cli import main; main()", "batch", str(inputs), "-o", str(output)]
    return [*start, *more]


@contextmanager
def started(*arguments: str, inputs: Path, output: Path) -> Iterator[subprocess.Popen]:
    """A running batch; it is killed at the end if it still runs."""
    run = subprocess.Popen(
        command(inputs, output, *arguments), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        yield run
    finally:
        run.send_signal(signal.SIGKILL)
        run.wait()


def timed(inputs: Path, output: Path, *arguments: str) -> tuple[float, int, str]:
    """Duration of a batch (s), its exit code and its last line."""
    begin = time.perf_counter()
    done = subprocess.run(command(inputs, output, *arguments), capture_output=True, text=True)
    return time.perf_counter() - begin, done.returncode, done.stdout.splitlines()[-1]


def family(process: int) -> set[int]:
    """Numbers of a process and of all processes that it started."""
    found, parents = {process}, {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal():
            try:
                parents[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            except OSError:
                continue
    for _ in range(3):
        found |= {child for child, parent in parents.items() if parent in found}
    return found


def resident(process: int) -> int:
    """Memory that a process takes (bytes); 0 if it is gone."""
    try:
        return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0
