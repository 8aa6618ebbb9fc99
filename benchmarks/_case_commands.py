"""Cases about what commands do to files, and how they end: acted out as their READMEs say."""

import hashlib
import os
import pickle
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from _case import Case, Rows, copied, jaxskel, listing, refused, wanted

from jaxskel import Status
from jaxskel.batch._folders import ResultFolder
from jaxskel.io import read_poses

_WALK = "batch_deletes_input/walk"
_PAPER = ("--preset", "paper")
# What is refused is refused within this time (s), start-up of a busy machine included.
_SOON = 60.0


def _kept(before: dict[Path, bytes | str], case: Case) -> None:
    """Nothing that was there is gone or changed."""
    after = listing(case.path)
    lost = [str(path.relative_to(case.path)) for path, content in before.items() if after.get(path) != content]
    wanted(not lost, f"lost or changed: {', '.join(lost[:3])}")


def _deletes_input(case: Case) -> str:
    (case.path / "W").mkdir()
    shutil.move(case.path / "walk", case.path / "W/walk")
    before = listing(case.path)
    run = jaxskel(case, "run", "W/walk", "-o", "W/walk", *_PAPER)
    _kept(before, case)
    told = refused(case, "batch", "W", "-o", "W", *_PAPER)
    _kept(before, case)
    return f"run {run.code}, batch 2: {told}"


def _deletes_user_files(case: Case) -> str:
    case.beside(_WALK)
    first = jaxskel(case, "batch", "walk", "-o", "P", *_PAPER)
    wanted(first.code == 0, first.last)
    (case.path / "P/walk/notes.txt").write_text("mine")
    again = jaxskel(case, "batch", "walk", "-o", "P", *_PAPER, "--smooth", "6")
    names = sorted(path.name for path in (case.path / "P/walk").iterdir())
    wanted((case.path / "P/walk/notes.txt").read_text() == "mine", "notes.txt was changed")
    wanted(again.code in (0, 2), f"exit code {again.code}, {again.last}")
    return f"exit code {again.code}; {', '.join(names)}"


def _dev_zero(case: Case) -> str:
    for view in case.beside(_WALK).glob("cam*"):  # the case has no images
        if not (case.path / "r" / view.name).exists():
            view.rename(case.path / "r" / view.name)
    told = refused(case, "run", "r", "-o", "O", says="/dev/zero", seconds=_SOON)
    refused(case, "run", "/dev/zero", "-o", "O", seconds=_SOON)
    (case.path / "x.npz").symlink_to("/dev/zero")
    refused(case, "run", "x.npz", "-o", "O", seconds=_SOON)
    return f"{told}; {_failed(case, 'r', '/dev/zero')}"


def _failed(case: Case, source: str, says: str) -> str:
    """`batch` ends soon and reports a recording as failed, in a table."""
    done = jaxskel(case, "batch", source, "-o", "O", *_PAPER, seconds=_SOON)
    said = " ".join((done.out + done.err).split())
    wanted(done.code == 1 and "1 failed" in said and says in said, f"batch: exit code {done.code}, {done.last}")
    return f"batch: {done.out.strip().splitlines()[-1]}"


def _changed(case: Case) -> str:
    """Other images for the time of the work: told, or poses of the images that the manifest names."""
    walk = case.beside(_WALK)
    clean = jaxskel(case, "batch", "walk", "-o", "clean", *_PAPER)
    wanted(clean.code == 0, clean.last)
    copied(walk, case.path / "as it was")
    command = [sys.executable, "-c", "from jaxskel.cli import main; main()", "batch", "walk", "-o", "O", *_PAPER]
    batch = subprocess.Popen(
        command, cwd=case.path, start_new_session=True, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    try:
        lock = ResultFolder(case.path / "O", "walk").lock
        until = time.monotonic() + _SOON
        while not lock.exists() and time.monotonic() < until:
            time.sleep(0.005)
        time.sleep(0.15)
        os.killpg(batch.pid, signal.SIGSTOP)
        for name in ("cam0", "cam5"):  # of a camera at another place
            shutil.copytree(walk / "cam7", walk / name, dirs_exist_ok=True)
        os.killpg(batch.pid, signal.SIGCONT)
        time.sleep(3)
        shutil.copytree(case.path / "as it was", walk, dirs_exist_ok=True)
        said = batch.communicate(timeout=240)[0]
    finally:
        if batch.poll() is None:
            os.killpg(batch.pid, signal.SIGKILL)
            batch.wait()
    last = said.strip().splitlines()[-1]
    if batch.returncode:
        wanted("changed while" in " ".join(said.split()), f"exit code {batch.returncode}, {last}")
        return "failed, changed while it was read"
    found, right = (read_poses(case.path / place / "walk/poses.npz").joints for place in ("O", "clean"))
    wanted(np.array_equal(found, right, equal_nan=True), f"done, with poses of other images: {last}")
    return "poses of the images that the manifest names" + (", started over" if "started over" in said else "")


def _dots(case: Case) -> str:
    for name in ("O", "O/other"):
        (case.path / name).mkdir()
    for name in ("poses.npz", "keep.txt"):
        (case.path / "O" / name).touch()
    before = listing(case.path)
    told = refused(case, "batch", "..npz", "-o", "O", *_PAPER)
    walk = case.beside(_WALK)
    (walk / "below").mkdir()
    done = jaxskel(Case(walk / "below", case.root), "batch", "..", "-o", case.path / "Q", *_PAPER)
    _kept(before, case)
    left = [str(path) for path in case.path.rglob("*.part*")]
    wanted(not left, f"left: {left}")
    wanted(done.code == 2 or (case.path / "Q/walk/poses.npz").exists(), f"batch ..: {done.code}, {done.last}")
    return f"{told}; batch ..: exit code {done.code}" + (", as walk" if done.code == 0 else "")


def _deep_key(case: Case) -> str:
    told = refused(case, "run", "r", "-o", "O", seconds=_SOON)
    return f"{told[:120]}; {_failed(case, 'r', 'recording.toml')}"


class _Marking:
    """Leaves a mark where it is unpickled."""

    def __init__(self, mark: Path):
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


def _cache(case: Case) -> str:
    case.scene()
    folder, mark = case.path / "cache", case.path / "mark"
    check = ("check", "scene.npz", "-o", "check.png")
    options = {"JAX_COMPILATION_CACHE_DIR": str(folder), "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}
    wanted(jaxskel(case, *check, environment=options).code in (0, 1), "check fails")
    wanted(folder.stat().st_mode & 0o077 == 0, f"the folder was made with {folder.stat().st_mode & 0o777:o}")
    files = [path for path in (folder / "jaxskel").rglob("*") if path.is_file()]
    wanted(files, "nothing was kept")
    content = pickle.dumps(_Marking(mark))
    for path in files:
        path.write_bytes(hashlib.sha256(content).digest() + content)
        path.chmod(0o666)
    done = jaxskel(case, *check, environment=options)
    wanted(not mark.exists(), "code of a file that others may write was run")
    wanted(done.code in (0, 1), f"check: exit code {done.code}, {done.last}")
    said = done.err.count("others may write it")
    wanted(said == 1, f"said {said} times")
    return f"0700; {len(files)} files that others may write are not loaded, said once"


def _codepoint(case: Case) -> str:
    return refused(case, "run", "names_badcp.npz", "-o", "O", seconds=_SOON)


def _suffix(case: Case) -> str:
    case.scene()
    return refused(case, "check", "scene.npz", "-o", "out/chk", seconds=_SOON)


def _fifo(case: Case) -> str:
    walk = case.beside(_WALK)
    (case.path / "D").mkdir()
    for name in ("x.npz", "D/x.npz"):
        os.mkfifo(case.path / name)
    told = refused(case, "run", "x.npz", "-o", "O", seconds=_SOON)
    for name in ("calibration.toml", "cam0/0000.png", "recording.toml"):
        (walk / name).rename(walk / "put away")
        os.mkfifo(walk / name)
        refused(case, "run", "walk", "-o", "O", *_PAPER, seconds=_SOON)
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
    done = jaxskel(case, "batch", "in", "-o", "O", "-j", "2", *_PAPER)
    wanted(done.code == 0, done.last)
    return f"{' and '.join(sorted(path.name for path in locks))}; both done"


def _limit(case: Case) -> str:
    case.scene()
    run = jaxskel(case, "run", "scene.npz", "-o", "P", *_PAPER)
    wanted(run.code == 0, run.last)
    return refused(case, "report", "scene.npz", "P/poses.npz", "-o", "r.html", "--limit", "inf", seconds=_SOON)


def _no_utf_8(case: Case) -> str:
    folder = case.path / os.fsdecode(b"ok\xff")
    case.beside(_WALK).rename(folder)
    run = jaxskel(case, "run", folder, "-o", "P", *_PAPER)
    report = jaxskel(case, "report", folder, "P/poses.npz", "-o", "r.html")
    wanted((run.code, report.code) == (0, 0), f"run {run.code}, report {report.code}: {report.last}")
    wanted("ok\ufffd" in (case.path / "r.html").read_text("utf-8"), "the page does not show ok\ufffd")
    return "run 0, report 0, a page of ok\ufffd"


def _loops(case: Case) -> str:
    (case.path / "L").mkdir()
    case.beside(_WALK).rename(case.path / "L/walk")
    for name in ("a", "b"):
        (case.path / "L" / name).symlink_to(".")
    done = jaxskel(case, "batch", "L", "-o", "O", *_PAPER)
    wanted(done.code == 0 and "1 recordings" in done.last, f"exit code {done.code}, {done.last}")
    return done.out.strip().splitlines()[-1]


def _markup(case: Case) -> str:
    # The folder x[ with b] in it: its name is the path x[/b].
    for command in (("batch", "in", "-o", "O"), ("summary", "O")):
        done = jaxskel(case, *command)
        wanted(done.code in (0, 1), f"{command[0]}: exit code {done.code}, {done.last}")
        said = "".join(done.out.split())
        missing = [name for name in ("plain[red]", "x[/b]") if name not in said]
        wanted(not missing, f"{command[0]} does not show {missing}")
    return f"both names as they are; {done.out.strip().splitlines()[-1]}"


def _tiny(case: Case) -> str:
    done = jaxskel(case, "run", "tiny64x48.npz", "-o", "O", *_PAPER)
    names = [Status(int(status)).name.lower() for status in read_poses(case.path / "O/poses.npz").status]
    wanted(done.code == 0 and set(names) <= {"ok", "view_lost", "not_converged"}, f"exit code {done.code}, {names}")
    return f"exit code 0, {', '.join(names)}"


COMMANDS: Rows = {
    "batch_deletes_input": ("refused; nothing is gone", _deletes_input),
    "batch_deletes_user_files": ("notes.txt stays", _deletes_user_files),
    "batch_dev_zero": ("refused in one line; batch: failed", _dev_zero),
    "batch_input_changed_while_read": ("failed or started over, told", _changed),
    "batch_name_dots": ("refused or resolved; nothing is gone", _dots),
    "batch_toml_deep_key": ("refused soon; batch: failed", _deep_key),
    "cache_pickle": ("0700; files of others are not loaded", _cache),
    "camera_names_bad_codepoint": ("exit code 2, one line", _codepoint),
    "check_no_suffix": ("exit code 2, one line, before the work", _suffix),
    "fifo": ("refused in one line; batch: failed", _fifo),
    "lock_name_collision": ("two locks; both done", _locks),
    "report_limit_inf": ("exit code 2, one line", _limit),
    "report_non_utf8_name": ("a page with a replacement character", _no_utf_8),
    "symlink_double_loop": ("one recording, done once", _loops),
    "table_markup": ("names as they are, no traceback", _markup),
    "tiny_64x48": ("a pose, or a true reason", _tiny),
}
