"""Where a recording's result is, and how it gets there: whole, or not at all."""

import errno
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from .._poses import Poses
from ..io import write_poses
from ._journal import Journal
from ._manifest import MANIFEST_FILE, Manifest, Outcome, read_manifest, write_manifest

RESULT_FILES = ("poses.npz", "poses.csv", MANIFEST_FILE)
FAILED_SUFFIX = ".failed.json"


@dataclass(frozen=True)
class ResultFolder:
    """The place of one recording's result.

    The result is a folder that is renamed when it is whole. Until then it is hidden beside its place; a kill at any
    moment leaves the old result, or the new one, or a folder to go on with.
    """

    output: Path
    name: str

    @property
    def path(self) -> Path:
        """The result."""
        return self.output / self.name

    @property
    def lock(self) -> Path:
        """The file that is locked while a process works on the recording."""
        return self.output / ".locks" / f"{self.name.replace('/', '__')}.lock"

    @property
    def failure(self) -> Path:
        """Why there is no result."""
        return self.path.with_name(self.path.name + FAILED_SUFFIX)

    def finished(self) -> Manifest | None:
        """The manifest of a whole result, of whatever work."""
        return _whole(self.path)

    def journal(self, work: str, request: str) -> Journal:
        """Poses of earlier attempts at the same work, to go on with, or an empty one."""
        return Journal(self._unfinished / "journal", work, request)

    def finish(self, poses: Poses, manifest: Manifest) -> None:
        """Write a result and put it in its place."""
        folder = self._unfinished
        for file in write_poses(folder, poses):
            _to_disk(file)
        # The manifest is last: with it, the result is whole.
        write_manifest(folder / MANIFEST_FILE, manifest)
        _to_disk(folder / MANIFEST_FILE)
        self.take_place()
        self.failure.unlink(missing_ok=True)

    def fail(self, manifest: Manifest) -> None:
        """Say why there is no result; an older result stays, and so does what is done of the new one."""
        write_manifest(self.failure, manifest)

    def take_place(self) -> None:
        """Put a result that is whole in its place: for `finish`, or after a kill in the midst of it.

        Raises:
            FileExistsError: Something else is there.
        """
        old = self._hidden("old")
        if _whole(self._unfinished) is not None:
            shutil.rmtree(self._unfinished / "journal", ignore_errors=True)
            if self.path.exists():
                if not any((self.path / name).exists() for name in RESULT_FILES):
                    raise FileExistsError(errno.EEXIST, "is no result, but in the way of one", str(self.path))
                shutil.rmtree(old, ignore_errors=True)
                os.rename(self.path, old)
            os.rename(self._unfinished, self.path)
        if self.path.exists():
            shutil.rmtree(old, ignore_errors=True)

    @property
    def _unfinished(self) -> Path:
        return self._hidden("part")

    def _hidden(self, suffix: str) -> Path:
        return self.path.with_name(f".{self.path.name}.{suffix}")


def _whole(folder: Path) -> Manifest | None:
    """The manifest of a folder that holds all files of a result."""
    if not all((folder / name).is_file() for name in RESULT_FILES):
        return None
    try:
        manifest = read_manifest(folder / MANIFEST_FILE)
    except ValueError:
        return None
    return None if manifest.outcome is Outcome.FAILED else manifest


def _to_disk(file: Path) -> None:
    """Wait until a file would outlast a loss of power."""
    with open(file, "rb+") as opened:
        os.fsync(opened.fileno())
