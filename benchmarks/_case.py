"""A case that once went wrong: runs commands in a copy of its folder and compares their results."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, Float

from jaxskel import Cameras, Recording, pack_silhouettes
from jaxskel.io.calibrations import read_calibration
from jaxskel.io.poses import read_poses
from jaxskel.io.recordings import write_recording
from jaxskel.synthetic import camera_ring, make_scene

FPS = 30.0
"""Of all folders of masks, because nothing in them gives it."""
# A command that takes longer (s) counts as hanging. The slowest one compiles, which takes a minute on a busy machine.
_PATIENCE = 240.0
SOON = 60.0
"""Wrong input must be refused within this time (s), including the start-up on a busy machine."""
PAPER = ("--preset", "paper")
WALK = "batch_deletes_input/walk"
"""A recording of two frames that several cases use."""
# The case with correct masks and calibration. Others were made from it.
_GOOD = "words_clean"


class NotAsExpected(Exception):
    """What happened instead, in a few words."""


@dataclass(frozen=True)
class Case:
    """A case, in a folder that may be written."""

    path: Path
    """A copy of the case without its README; commands run in it."""
    root: Path
    """The original folder of all cases."""

    def beside(self, name: str) -> Path:
        """A copy of what another case holds."""
        source, place = self.root / name, self.path / Path(name).name
        if not source.exists():
            raise NotAsExpected(f"{name} is not there to copy")
        copied(source, place)
        return place

    def scene(self) -> Path:
        """A small recording made from nothing."""
        place = self.path / "scene.npz"
        write_recording(place, make_scene(2, cameras=camera_ring(6, size=(320, 240))))
        return place


@dataclass(frozen=True)
class Done:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def last(self) -> str:
        """The last line of the output, or an empty string."""
        return ((self.err or self.out).strip().splitlines() or [""])[-1]


def jaxskel(
    case: Case, *arguments: object, seconds: float = _PATIENCE, environment: Mapping[str, str] | None = None
) -> Done:
    """Run `jaxskel` as its users do. It must end, and without a traceback.

    Raises:
        NotAsExpected: It hangs or ends with a traceback.
    """
    command = [sys.executable, "-c", "from jaxskel.cli import main; main()", *map(str, arguments)]
    process = subprocess.Popen(
        command, cwd=case.path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL,
        start_new_session=True, env={**os.environ, **(environment or {})},
    )  # fmt: skip
    try:
        out, err = (text.decode(errors="replace") for text in process.communicate(timeout=seconds))
    except subprocess.TimeoutExpired:
        raise NotAsExpected(f"{arguments[0]} has not ended after {seconds:g} s") from None
    finally:
        with suppress(ProcessLookupError):  # its workers too
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    if "Traceback" in out + err:
        raise NotAsExpected(f"{arguments[0]}: traceback, {err.strip().splitlines()[-1]}")
    return Done(process.returncode, out, err)


def wanted(holds: object, told: str) -> None:
    """Raise `NotAsExpected` with `told`, which says what happened, unless this holds."""
    if not holds:
        raise NotAsExpected(told)


def refused(case: Case, *arguments: object, says: str = "", seconds: float = SOON) -> str:
    """A command must end with exit code 2 and one line on standard error, and write and remove nothing.

    Returns:
        The line.
    """
    before = listing(case.path)
    done = jaxskel(case, *arguments, seconds=seconds)
    wanted(done.code == 2, f"{arguments[0]}: exit code {done.code}, {done.last}")
    lines = done.err.strip().splitlines()
    wanted(len(lines) == 1, f"{arguments[0]}: {len(lines)} lines on standard error")
    wanted(says in done.err, f"{arguments[0]}: does not say {says!r}: {done.last}")
    wanted(listing(case.path) == before, f"{arguments[0]}: refused, but files were written or lost")
    return lines[0].removeprefix("jaxskel: ")


def listing(folder: Path) -> dict[Path, bytes | str]:
    """The contents of a folder, to see what a command has changed."""
    found: dict[Path, bytes | str] = {}
    for place, folders, files in os.walk(folder):
        for path in (Path(place, name) for name in (*folders, *files)):
            if path.is_symlink() or not path.is_file():
                found[path] = "link" if path.is_symlink() else "folder" if path.is_dir() else "special"
            else:
                found[path] = path.read_bytes()
    return found


def copied(source: Path, place: Path) -> None:
    """Make a writable copy of a file or folder."""
    if source.is_dir():
        shutil.copytree(source, place, symlinks=True, ignore=shutil.ignore_patterns("README"))
    else:
        shutil.copy2(source, place)
    for path in (place, *place.rglob("*")):
        if not path.is_symlink():
            path.chmod(path.stat().st_mode | 0o200)


@dataclass(frozen=True)
class GoodScene:
    """The scene that most cases were made from, read without `jaxskel init`."""

    cameras: Cameras
    masks: Bool[np.ndarray, "F C H W"]


@cache
def good_scene(root: Path) -> GoodScene:
    """The scene of the correct case."""
    folder = root / _GOOD
    if not folder.is_dir():
        raise NotAsExpected(f"{_GOOD} is not there to compare with")
    cameras = read_calibration(folder / "Calib_scene.toml").cameras
    views = [sorted((folder / "masks_clean" / name).iterdir()) for name in cameras.names]
    return GoodScene(cameras, np.stack([np.stack([_white(path) for path in view]) for view in views], axis=1))


def _white(path: Path) -> Bool[np.ndarray, "H W"]:
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise NotAsExpected(f"{path} cannot be read")
    return image > 127


@cache
def _good_joints(root: Path, place: Path) -> Float[np.ndarray, "F 15 3"]:
    scene = good_scene(root)
    recording = Recording(scene.cameras, pack_silhouettes(scene.masks), FPS, "+Z", np.arange(len(scene.masks)))
    write_recording(place / "good.npz", recording)
    done = jaxskel(Case(place, root), "run", "good.npz", "-o", "good", *PAPER)
    wanted(done.code == 0, f"the good scene gives no poses: {done.last}")
    return read_poses(place / "good/poses.npz").joints


def good_joints(case: Case) -> Float[np.ndarray, "F 15 3"]:
    """Joints of the good scene by `--preset paper` (m)."""
    return _good_joints(case.root, case.path.parent)


Act = Callable[[Case], str]
"""Does what a README describes; returns what happened in a few words, or raises `NotAsExpected`."""
Rows = dict[str, tuple[str, Act]]
"""Cases by name: the expected outcome in a few words, and the function to run."""
