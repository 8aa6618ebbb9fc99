"""Cases about the exit codes of other commands, run as their READMEs say."""

import hashlib
import os
import pickle
from pathlib import Path

from _case import PAPER, WALK, Case, Rows, jaxskel, refused, wanted

from jaxskel import Status
from jaxskel.io.poses import read_poses


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
    return refused(case, "run", "names_badcp.npz", "-o", "O")


def _suffix(case: Case) -> str:
    case.scene()
    return refused(case, "check", "scene.npz", "-o", "out/chk")


def _limit(case: Case) -> str:
    case.scene()
    run = jaxskel(case, "run", "scene.npz", "-o", "P", *PAPER)
    wanted(run.code == 0, run.last)
    return refused(case, "report", "scene.npz", "P/poses.npz", "-o", "r.html", "--limit", "inf")


def _no_utf_8(case: Case) -> str:
    folder = case.path / os.fsdecode(b"ok\xff")
    case.beside(WALK).rename(folder)
    run = jaxskel(case, "run", folder, "-o", "P", *PAPER)
    report = jaxskel(case, "report", folder, "P/poses.npz", "-o", "r.html")
    wanted((run.code, report.code) == (0, 0), f"run {run.code}, report {report.code}: {report.last}")
    wanted("ok\ufffd" in (case.path / "r.html").read_text("utf-8"), "the page does not show ok\ufffd")
    return "run 0, report 0, a page of ok\ufffd"


def _tiny(case: Case) -> str:
    done = jaxskel(case, "run", "tiny64x48.npz", "-o", "O", *PAPER)
    names = [Status(int(status)).name.lower() for status in read_poses(case.path / "O/poses.npz").status]
    wanted(done.code == 0 and set(names) <= {"ok", "view_lost", "not_converged"}, f"exit code {done.code}, {names}")
    return f"exit code 0, {', '.join(names)}"


COMMANDS: Rows = {
    "cache_pickle": ("0700; files of others are not loaded", _cache),
    "camera_names_bad_codepoint": ("exit code 2, one line", _codepoint),
    "check_no_suffix": ("exit code 2, one line, before the work", _suffix),
    "report_limit_inf": ("exit code 2, one line", _limit),
    "report_non_utf8_name": ("a page with a replacement character", _no_utf_8),
    "tiny_64x48": ("a pose, or a true reason", _tiny),
}
