"""The folder of a recording's result: a result is put there as a whole, and no other file is harmed."""

import os
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from ..io.files import fault, is_ours
from ..io.poses import write_poses
from ..io.recordings import holds_silhouettes
from ..poses import Poses
from ._disk import remove_unfinished, to_disk
from ._inputs import Input, read_inputs
from ._journal import Journal, discard_journal
from ._manifest import Manifest, Outcome, is_manifest, read_manifest, write_manifest
from ._names import FAILED_SUFFIX, MANIFEST_FILE, POSES_FILES, RESULT_FILES, lock_name


@dataclass(frozen=True)
class ResultFolder:
    """The folder of one recording's result.

    A new result is first written into a hidden folder beside it, the manifest last. Then the old manifest is removed,
    the poses are moved into the folder one by one, and the new manifest is moved last. So a folder with a manifest
    holds a complete result. A kill at any moment leaves the old result, or a new one that only has to be moved, or
    poses to continue from. Other files in the folder are not touched.
    """

    output: Path
    name: str

    @property
    def path(self) -> Path:
        """The folder of the result."""
        return self.output / self.name

    @property
    def lock(self) -> Path:
        """The file that is locked while a process works on the recording."""
        return self.output / ".locks" / lock_name(self.name)

    @property
    def failure(self) -> Path:
        """The file that says why there is no result."""
        return self.path.with_name(self.path.name + FAILED_SUFFIX)

    @property
    def files(self) -> tuple[Path, ...]:
        """All files that are written outside hidden folders."""
        return *(self.path / name for name in RESULT_FILES), self.failure

    @property
    def written(self) -> tuple[Path, ...]:
        """The folders in which files are created, except the output itself."""
        return *self._above, self.lock.parent, self._unfinished, self._unfinished / "journal"

    def finished(self) -> Manifest | None:
        """The manifest of a complete result, whatever it was made from; None if there is none."""
        manifest = _readable(self.path)
        if manifest is None or manifest.outcome is Outcome.FAILED:
            return None
        return manifest if not self._unknown(manifest) and all(self._there(name) for name in POSES_FILES) else None

    def check(self) -> None:
        """Refuse, before anything is written, a place where something is in the way.

        Raises:
            ValueError: One line that names what is in the way.
        """
        for folder in self.written:
            if os.path.lexists(folder) and not folder.is_dir():
                raise fault(folder, None, "is not a folder, but a folder is needed here; move it away")
        # Files written through a link would be somewhere else.
        for folder in (self.path, self._unfinished, self._unfinished / "journal"):
            if folder.is_symlink():
                raise fault(folder, None, "is a link, but a result needs its own folder; move it away")
        if self.path.exists() and self.path.stat().st_dev != self.path.parent.stat().st_dev:
            raise fault(self.path, None, "is a separate disk, so files cannot be moved into it; choose another output")
        # If there is a manifest, files that it does not list are renamed, not replaced.
        is_pose_file = _is_own if _readable(self.path) is None else Path.is_file
        checks = dict.fromkeys(POSES_FILES, is_pose_file) | {MANIFEST_FILE: is_manifest}
        for file, is_own in ((self.failure, is_manifest), *((self.path / name, own) for name, own in checks.items())):
            if os.path.lexists(file) and not is_own(file):
                raise fault(
                    file, None, "was not written by jaxskel, and a result would replace it; move it away, or choose "
                    "another output",
                )  # fmt: skip

    def journal(self, work: str, request: str) -> Journal:
        """The journal with the poses of earlier attempts at the same work, or an empty one."""
        return Journal(self._unfinished / "journal", work, request)

    def discard_journal(self) -> None:
        """Delete the poses of earlier attempts."""
        discard_journal(self._unfinished / "journal")

    def finish(self, poses: Poses, manifest: Manifest) -> Manifest:
        """Write a result and move it into its folder; return its manifest as written."""
        folder = self._unfinished
        (folder / MANIFEST_FILE).unlink(missing_ok=True)
        for file in write_poses(folder, poses):
            to_disk(file)
        aside = self._set_aside()
        notes = [manifest.note] if manifest.note else []
        notes += [f"changed files were renamed to {', '.join(file.name for file in aside)}"] if aside else []
        results = read_inputs({name: folder / name for name in POSES_FILES})
        manifest = replace(manifest, results=results, note="; ".join(notes))
        # The manifest is written last, because it marks the result as complete.
        write_manifest(folder / MANIFEST_FILE, manifest)
        to_disk(folder / MANIFEST_FILE)
        to_disk(folder)
        self.take_place()
        self.forget_failure()
        return manifest

    def fail(self, manifest: Manifest) -> None:
        """Write why there is no result; an older result stays, and so do finished parts of the new one."""
        if is_manifest(self.failure) or not os.path.lexists(self.failure):
            write_manifest(self.failure, manifest)

    def forget_failure(self) -> None:
        """Remove the record of an earlier failure."""
        if is_manifest(self.failure):
            self.failure.unlink()

    def take_place(self) -> None:
        """Move a complete result into its folder: for `finish`, or after it was killed half-way.

        Raises:
            ValueError: Something is in the way.
        """
        if self._is_ready():
            self.check()
            self._set_aside()
            # The journal is no longer needed.
            self.discard_journal()
            for name in RESULT_FILES:
                remove_unfinished(self._unfinished / name)
            self.path.mkdir(parents=True, exist_ok=True)
            (self.path / MANIFEST_FILE).unlink(missing_ok=True)
            to_disk(self.path)
            for name in RESULT_FILES:
                if (self._unfinished / name).exists():
                    os.replace(self._unfinished / name, self.path / name)
            to_disk(self.path)
        with suppress(OSError):  # it is not there, or not empty
            self._unfinished.rmdir()

    @property
    def _above(self) -> list[Path]:
        """The result's folder, and those above it that the batch creates."""
        return [self.path, *list(self.path.parents)[: self.name.count("/")]]

    @property
    def _unfinished(self) -> Path:
        return self.path.with_name(f".{self.path.name}.part")

    def _there(self, name: str) -> bool:
        return (self.path / name).is_file()

    def _is_ready(self) -> bool:
        """Whether a new result is complete: still in the hidden folder, or partly moved."""
        manifest = _readable(self._unfinished)
        if manifest is None or manifest.outcome is Outcome.FAILED:
            return False
        waiting = [name for name in POSES_FILES if (self._unfinished / name).is_file()]
        arrived = {name: manifest.results[name] for name in POSES_FILES if name in manifest.results}
        return all(name in waiting or self._holds(name, arrived.get(name)) for name in POSES_FILES)

    def _holds(self, name: str, known: Input | None) -> bool:
        """Whether a file in the result's folder is the one that the manifest lists."""
        if known is None or not self._there(name):
            return False
        return read_inputs({name: self.path / name}, {name: known})[name].sha256 == known.sha256

    def _unknown(self, manifest: Manifest) -> list[str]:
        """Files with the names of poses that are not poses, or not those that the manifest lists."""
        unknown = []
        for name in POSES_FILES:
            file = self.path / name
            if not os.path.lexists(file):
                continue
            known = manifest.results.get(name)
            is_own = _is_own(file) if known is None else self._holds(name, known)
            if not is_own or file.is_symlink():
                unknown.append(name)
        return unknown

    def _set_aside(self) -> list[Path]:
        """Rename poses that somebody has changed since the old manifest was written; return the new paths."""
        manifest, aside = _readable(self.path), []
        for name in self._unknown(manifest) if manifest is not None else ():
            places = (self.path / f"{name}.changed{number or ''}" for number in range(1000))
            aside.append(next(place for place in places if not os.path.lexists(place)))
            os.rename(self.path / name, aside[-1])
        return aside


def _is_own(file: Path) -> bool:
    """Whether a file with the name of poses holds poses. A recording does not count, even if it has poses in it."""
    return not file.is_symlink() and is_ours(file) and not (file.suffix == ".npz" and holds_silhouettes(file))


def _readable(folder: Path) -> Manifest | None:
    try:
        return read_manifest(folder / MANIFEST_FILE)
    except ValueError:
        return None
