"""Cases about the files and exit codes of a batch, run as their READMEs say."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from _case import PAPER, SOON, WALK, Case, Rows, copied, jaxskel, listing, refused, wanted

from jaxskel.batch import ResultFolder
from jaxskel.io.poses import read_poses


def _kept(before: dict[Path, bytes | str], case: Case) -> None:
    """No existing file has been removed or changed."""
    after = listing(case.path)
    lost = [str(path.relative_to(case.path)) for path, content in before.items() if after.get(path) != content]
    wanted(not lost, f"lost or changed: {', '.join(lost[:3])}")


def _failed(case: Case, source: str, says: str) -> str:
    """`batch` ends soon and reports a recording as failed, in a table."""
    done = jaxskel(case, "batch", source, "-o", "O", *PAPER, seconds=SOON)
    said = " ".join((done.out + done.err).split())
    wanted(done.code == 1 and "1 failed" in said and says in said, f"batch: exit code {done.code}, {done.last}")
    return f"batch: {done.out.strip().splitlines()[-1]}"


def _deletes_input(case: Case) -> str:
    (case.path / "W").mkdir()
    shutil.move(case.path / "walk", case.path / "W/walk")
    before = listing(case.path)
    run = jaxskel(case, "run", "W/walk", "-o", "W/walk", *PAPER)
    _kept(before, case)
    told = refused(case, "batch", "W", "-o", "W", *PAPER)
    _kept(before, case)
    return f"run {run.code}, batch 2: {told}"


def _deletes_user_files(case: Case) -> str:
    case.beside(WALK)
    first = jaxskel(case, "batch", "walk", "-o", "P", *PAPER)
    wanted(first.code == 0, first.last)
    (case.path / "P/walk/notes.txt").write_text("mine")
    again = jaxskel(case, "batch", "walk", "-o", "P", *PAPER, "--smooth", "6")
    names = sorted(path.name for path in (case.path / "P/walk").iterdir())
    wanted((case.path / "P/walk/notes.txt").read_text() == "mine", "notes.txt was changed")
    wanted(again.code in (0, 2), f"exit code {again.code}, {again.last}")
    return f"exit code {again.code}; {', '.join(names)}"


def _dev_zero(case: Case) -> str:
    for view in case.beside(WALK).glob("cam*"):  # the case has no images
        if not (case.path / "r" / view.name).exists():
            view.rename(case.path / "r" / view.name)
    told = refused(case, "run", "r", "-o", "O", says="/dev/zero")
    refused(case, "run", "/dev/zero", "-o", "O")
    (case.path / "x.npz").symlink_to("/dev/zero")
    refused(case, "run", "x.npz", "-o", "O")
    return f"{told}; {_failed(case, 'r', '/dev/zero')}"


def _changed(case: Case) -> str:
    """Images exchanged during the work: must be reported, or the poses are of the images that the manifest names."""
    walk = case.beside(WALK)
    clean = jaxskel(case, "batch", "walk", "-o", "clean", *PAPER)
    wanted(clean.code == 0, clean.last)
    copied(walk, case.path / "as it was")
    command = [sys.executable, "-c", "from jaxskel.cli import main; main()", "batch", "walk", "-o", "O", *PAPER]
    batch = subprocess.Popen(
        command, cwd=case.path, start_new_session=True, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    try:
        lock = ResultFolder(case.path / "O", "walk").lock
        until = time.monotonic() + SOON
        while not lock.exists() and time.monotonic() < until:
            time.sleep(0.005)
        time.sleep(0.15)
        os.killpg(batch.pid, signal.SIGSTOP)
        for name in ("cam0", "cam5"):  # images from a camera at another place
            shutil.copytree(walk / "cam7", walk / name, dirs_exist_ok=True)
        os.killpg(batch.pid, signal.SIGCONT)
        time.sleep(3)
        shutil.copytree(case.path / "as it was", walk, dirs_exist_ok=True)
        said = batch.communicate(timeout=240)[0]
    finally:
        if batch.poll() is None:
            os.killpg(batch.pid, signal.SIGKILL)
            batch.wait()
    told = " ".join(said.split())
    if batch.returncode:
        wanted("changed while" in told, f"exit code {batch.returncode}, {said.strip().splitlines()[-1]}")
    # If all was read while the images were exchanged, the result is of the exchanged images, as its manifest says.
    again = jaxskel(case, "batch", "walk", "-o", "O", *PAPER)
    found, right = (read_poses(case.path / place / "walk/poses.npz").joints for place in ("O", "clean"))
    wanted(again.code == 0 and np.array_equal(found, right, equal_nan=True), "poses of other images are kept for good")
    ends = {"started over": "started over", "changed while": "failed, told", "": "poses of the other images, not kept"}
    return f"{next(end for word, end in ends.items() if word in told)}; with the images back, their poses"


def _dots(case: Case) -> str:
    for name in ("O", "O/other"):
        (case.path / name).mkdir()
    for name in ("poses.npz", "keep.txt"):
        (case.path / "O" / name).touch()
    before = listing(case.path)
    told = refused(case, "batch", "..npz", "-o", "O", *PAPER)
    walk = case.beside(WALK)
    (walk / "below").mkdir()
    done = jaxskel(Case(walk / "below", case.root), "batch", "..", "-o", case.path / "Q", *PAPER)
    _kept(before, case)
    left = [str(path) for path in case.path.rglob("*.part*")]
    wanted(not left, f"left: {left}")
    wanted(done.code == 2 or (case.path / "Q/walk/poses.npz").exists(), f"batch ..: {done.code}, {done.last}")
    return f"{told}; batch ..: exit code {done.code}" + (", as walk" if done.code == 0 else "")


def _deep_key(case: Case) -> str:
    told = refused(case, "run", "r", "-o", "O")
    return f"{told[:120]}; {_failed(case, 'r', 'recording.toml')}"


def _fifo(case: Case) -> str:
    walk = case.beside(WALK)
    (case.path / "D").mkdir()
    for name in ("x.npz", "D/x.npz"):
        os.mkfifo(case.path / name)
    told = refused(case, "run", "x.npz", "-o", "O")
    for name in ("calibration.toml", "cam0/0000.png", "recording.toml"):
        (walk / name).rename(walk / "put away")
        os.mkfifo(walk / name)
        refused(case, "run", "walk", "-o", "O", *PAPER)
        (walk / name).unlink()
        (walk / "put away").rename(walk / name)
    return f"{told}; {_failed(case, 'D', 'FIFO')}"


def _locks(case: Case) -> str:
    scene = case.scene()
    (case.path / "in/a").mkdir(parents=True)
    for name in ("a/b.npz", "a__b.npz"):
        shutil.copy(scene, case.path / "in" / name)
    locks = {ResultFolder(case.path / "O", name).lock for name in ("a/b", "a__b")}
    wanted(len(locks) == 2, f"both have {locks}")
    done = jaxskel(case, "batch", "in", "-o", "O", "-j", "2", *PAPER)
    wanted(done.code == 0, done.last)
    return f"{' and '.join(sorted(path.name for path in locks))}; both done"


def _loops(case: Case) -> str:
    (case.path / "L").mkdir()
    case.beside(WALK).rename(case.path / "L/walk")
    for name in ("a", "b"):
        (case.path / "L" / name).symlink_to(".")
    done = jaxskel(case, "batch", "L", "-o", "O", *PAPER)
    told = (done.out.strip().splitlines() or [done.last])[-1]
    wanted(done.code == 0 and "1 recordings, 1 done" in told, f"exit code {done.code}, {told}")
    return told


def _markup(case: Case) -> str:
    # The folder x[ with b] in it: its name is the path x[/b].
    for command in (("batch", "in", "-o", "O"), ("summary", "O")):
        done = jaxskel(case, *command, environment={"COLUMNS": "200"})
        wanted(done.code in (0, 1), f"{command[0]}: exit code {done.code}, {done.last}")
        said = "".join(done.out.split())
        missing = [name for name in ("plain[red]", "x[/b]") if name not in said]
        wanted(not missing, f"{command[0]} does not show {missing}")
    return f"both names as they are; {done.out.strip().splitlines()[-1]}"


BATCHES: Rows = {
    "batch_deletes_input": ("refused; nothing is gone", _deletes_input),
    "batch_deletes_user_files": ("notes.txt stays", _deletes_user_files),
    "batch_dev_zero": ("refused in one line; batch: failed", _dev_zero),
    "batch_input_changed_while_read": ("failed or started over, told", _changed),
    "batch_name_dots": ("refused or resolved; nothing is gone", _dots),
    "batch_toml_deep_key": ("refused soon; batch: failed", _deep_key),
    "fifo": ("refused in one line; batch: failed", _fifo),
    "lock_name_collision": ("two locks; both done", _locks),
    "symlink_double_loop": ("one recording, done once", _loops),
    "table_markup": ("names as they are, no traceback", _markup),
}
