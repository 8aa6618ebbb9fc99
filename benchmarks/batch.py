"""Measures `jaxskel batch`: recovery after kills, gain from a second process, and memory on a long recording.

    python benchmarks/batch.py survive WORK [--recordings 200] [--kills 10]
    python benchmarks/batch.py throughput WORK [--recordings 120] [--repeat 3]
    python benchmarks/batch.py memory WORK LONG.npz

WORK is a folder for recordings and results. Options after ``--`` are passed to the batch: ``-- --preset paper``.
"""

import argparse
import random
import shutil
import statistics
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
from _batch_runs import break_some, family, film, resident, started, timed

from jaxskel.batch._journal import row_of
from jaxskel.batch._manifest import read_manifest
from jaxskel.body import HUMAN_15


def survive(work: Path, recordings: int, kills: int, options: list[str]) -> bool:
    """Kill a batch repeatedly; in the end the results must be as if it had never been killed."""
    data = work / "data"
    shutil.rmtree(data, ignore_errors=True)
    broken = break_some(film(data, recordings, 12))
    reference, killed = work / "reference", work / "killed"
    for folder in (reference, killed):
        shutil.rmtree(folder, ignore_errors=True)
    seconds, code, line = timed(data, reference, *options)
    print(f"in one go: exit code {code}, {seconds:.0f} s: {line}")
    chance, finished = random.Random(0), {}
    twice = 0
    for number in range(kills):
        with started(*options, inputs=data, output=killed) as run, suppress(subprocess.TimeoutExpired):
            # Kill times from before the first recording until many recordings are done, or all are.
            run.wait(chance.uniform(0.1, 1.8 * seconds / kills))
        now = {path.parent.name: path.read_bytes() for path in killed.glob("*/manifest.json")}
        twice += sum(now.get(name) != content for name, content in finished.items())
        print(f"killed {number + 1}: {len(now)} recordings are done, {len(now) - len(finished)} of them since the last")
        finished = now
    seconds, code, line = timed(data, killed, *options)
    print(f"then to the end: exit code {code}, {seconds:.0f} s: {line}")
    now = {path.parent.name: path.read_bytes() for path in killed.glob("*/manifest.json")}
    twice += sum(now.get(name) != content for name, content in finished.items())
    same = sum(_same(folder, killed / folder.name) for folder in reference.glob("walk*/"))
    expected = recordings - len(broken)
    failures = sorted(path.name for path in killed.glob("*.failed.json"))
    print(f"byte for byte the same: {same} of {expected + 1}; computed twice: {twice}; failed: {', '.join(failures)}")
    return same == expected + 1 and twice == 0 and code == 1


def throughput(work: Path, recordings: int, repeat: int, options: list[str]) -> None:
    """Two processes against one, in turn."""
    data = work / "same"
    film(data, recordings, 32)
    times: dict[int, list[float]] = {1: [], 2: []}
    timed(data, work / "warm", "--force", "--jobs", "2", *options)
    for _ in range(repeat):
        for jobs, found in times.items():
            out = work / f"jobs{jobs}"
            shutil.rmtree(out, ignore_errors=True)
            seconds, code, line = timed(data, out, "--jobs", str(jobs), *options)
            found.append(seconds)
            print(f"--jobs {jobs}: exit code {code}, {seconds:.1f} s: {line}", flush=True)
    one, two = (statistics.median(found) for found in times.values())
    print(f"{recordings} recordings of 32 frames: {one:.1f} s with one process, {two:.1f} s with two: {one / two:.2f}")


def memory(work: Path, recording: Path, options: list[str]) -> None:
    """The loss by an early kill, then resident memory over time: medians over a thousand frames each."""
    out = work / "long"
    shutil.rmtree(out, ignore_errors=True)
    rows = out / f".{recording.stem}.part" / "journal" / "rows.bin"
    with np.load(recording) as arrays:
        total = len(arrays["frame_index"])

    def frames() -> int:
        return rows.stat().st_size // row_of(HUMAN_15).itemsize if rows.exists() else 0

    def watch(until: int) -> int:
        """Number of frames done when it ends."""
        told, last = 0, 0
        used: list[tuple[int, int]] = []
        with started("--jobs", "1", *options, inputs=recording, output=out) as run:
            while run.poll() is None:
                last = max(last, frames())
                taken = [resident(process) for process in family(run.pid)]
                used.append((max(taken), sum(taken)))
                if last // 1000 > told:
                    told = last // 1000
                    one, every = np.median(used, axis=0) / 1e6
                    most = max(used)[0] / 1e6
                    print(f"{last:6d} frames: {one:.0f} MB, at most {most:.0f}, all processes {every:.0f}", flush=True)
                    used.clear()
                if last >= until:
                    return last
                time.sleep(0.2)
            print(run.communicate()[0].splitlines()[-1])
        return total

    begin = time.perf_counter()
    done = watch(total // 20)
    kept = frames()
    print(f"killed at {done} frames, {kept} are kept")
    watch(total + 1)
    resumed = read_manifest(out / recording.stem / "manifest.json").resumed
    print(
        f"{total} frames in {time.perf_counter() - begin:.0f} s; taken up at {resumed}, of the {done} that were done "
        f"{100 * max(0, done - resumed) / total:.2f} % of all were lost"
    )


def _same(one: Path, other: Path) -> bool:
    return all((one / name).read_bytes() == (other / name).read_bytes() for name in ("poses.npz", "poses.csv"))


def main() -> None:
    """Run one of the three measurements."""
    own, options = sys.argv[1:], []
    if "--" in own:
        own, options = own[: own.index("--")], own[own.index("--") + 1 :]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parts = parser.add_subparsers(dest="part", required=True)
    for name in ("survive", "throughput", "memory"):
        part = parts.add_parser(name)
        part.add_argument("work", type=Path)
        if name == "memory":
            part.add_argument("recording", type=Path)
        else:
            count, times, default = (200, "--kills", 10) if name == "survive" else (120, "--repeat", 3)
            part.add_argument("--recordings", type=int, default=count)
            part.add_argument(times, type=int, default=default)
    given = parser.parse_args(own)
    if given.part == "survive":
        sys.exit(0 if survive(given.work, given.recordings, given.kills, options) else 1)
    elif given.part == "throughput":
        throughput(given.work, given.recordings, given.repeat, options)
    else:
        memory(given.work, given.recording, options)


if __name__ == "__main__":
    main()
