"""Where a recording's result is, and how it gets there: whole, and without harm to anything else."""

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
    """The place of one recording's result.

    A new result is written into a hidden folder beside its place, its manifest last. Then the old manifest is removed,
    the poses take their places one by one, and the new manifest comes last. So a folder with a manifest holds a whole
    result; and a kill at any moment leaves the old result, or a new one that only has to be put in its place, or poses
    to go on with. What else is in the folder is not touched.
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
        return self.output / ".locks" / lock_name(self.name)

    @property
    def failure(self) -> Path:
        """Why there is no result."""
        return self.path.with_name(self.path.name + FAILED_SUFFIX)

    @property
    def files(self) -> tuple[Path, ...]:
        """All that is written outside of hidden folders."""
        return *(self.path / name for name in RESULT_FILES), self.failure

    @property
    def written(self) -> tuple[Path, ...]:
        """The folders that files are made in, but for the output itself."""
        return *self._above, self.lock.parent, self._unfinished, self._unfinished / "journal"

    def finished(self) -> Manifest | None:
        """The manifest of a whole result, of whatever work."""
        manifest = _readable(self.path)
        if manifest is None or manifest.outcome is Outcome.FAILED:
            return None
        return manifest if not self._unknown(manifest) and all(self._there(name) for name in POSES_FILES) else None

    def check(self) -> None:
        """Refuse a place where something is in the way, before anything is written.

        Raises:
            ValueError: One line that names what is in the way.
        """
        for folder in self.written:
            if os.path.lexists(folder) and not folder.is_dir():
                raise fault(folder, None, "is no folder, but in the way of one; move it away")
        # Whoever works in them would work somewhere else.
        for folder in (self.path, self._unfinished, self._unfinished / "journal"):
            if folder.is_symlink():
                raise fault(folder, None, "is a link, but a result has a folder of its own; move it away")
        if self.path.exists() and self.path.stat().st_dev != self.path.parent.stat().st_dev:
            raise fault(self.path, None, "is a disk of its own, into which no file can be moved; choose another output")
        # Where there is a manifest, files that it does not tell of are set aside and not replaced.
        is_pose_file = _is_own if _readable(self.path) is None else Path.is_file
        checks = dict.fromkeys(POSES_FILES, is_pose_file) | {MANIFEST_FILE: is_manifest}
        for file, is_own in ((self.failure, is_manifest), *((self.path / name, own) for name, own in checks.items())):
            if os.path.lexists(file) and not is_own(file):
                raise fault(
                    file, None, "was not written by jaxskel, and a result would replace it; move it away, or choose "
                    "another output",
                )  # fmt: skip

    def journal(self, work: str, request: str) -> Journal:
        """Poses of earlier attempts at the same work, to go on with, or an empty one."""
        return Journal(self._unfinished / "journal", work, request)

    def discard_journal(self) -> None:
        """Throw away what earlier attempts have left to go on with."""
        discard_journal(self._unfinished / "journal")

    def finish(self, poses: Poses, manifest: Manifest) -> Manifest:
        """Write a result and put it in its place; return its manifest, as it was written."""
        folder = self._unfinished
        (folder / MANIFEST_FILE).unlink(missing_ok=True)
        for file in write_poses(folder, poses):
            to_disk(file)
        aside = self._set_aside()
        notes = [manifest.note] if manifest.note else []
        notes += [f"what had been changed is {', '.join(file.name for file in aside)} now"] if aside else []
        results = read_inputs({name: folder / name for name in POSES_FILES})
        manifest = replace(manifest, results=results, note="; ".join(notes))
        # The manifest is last: with it, the result is whole.
        write_manifest(folder / MANIFEST_FILE, manifest)
        to_disk(folder / MANIFEST_FILE)
        to_disk(folder)
        self.take_place()
        self.forget_failure()
        return manifest

    def fail(self, manifest: Manifest) -> None:
        """Say why there is no result; an older result stays, and so does what is done of the new one."""
        if is_manifest(self.failure) or not os.path.lexists(self.failure):
            write_manifest(self.failure, manifest)

    def forget_failure(self) -> None:
        """What went wrong before is over."""
        if is_manifest(self.failure):
            self.failure.unlink()

    def take_place(self) -> None:
        """Put a result that is whole in its place: for `finish`, or after a kill in the midst of it.

        Raises:
            ValueError: Something is in the way.
        """
        if self._is_ready():
            self.check()
            self._set_aside()
            # What led to it is not needed any more.
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
        with suppress(OSError):  # there is something to go on with, or something else
            self._unfinished.rmdir()

    @property
    def _above(self) -> list[Path]:
        """The result's folder, and those above it that the batch makes."""
        return [self.path, *list(self.path.parents)[: self.name.count("/")]]

    @property
    def _unfinished(self) -> Path:
        return self.path.with_name(f".{self.path.name}.part")

    def _there(self, name: str) -> bool:
        return (self.path / name).is_file()

    def _is_ready(self) -> bool:
        """Whether a new result is whole, beside its place or on the way into it."""
        manifest = _readable(self._unfinished)
        if manifest is None or manifest.outcome is Outcome.FAILED:
            return False
        waiting = [name for name in POSES_FILES if (self._unfinished / name).is_file()]
        arrived = {name: manifest.results[name] for name in POSES_FILES if name in manifest.results}
        return all(name in waiting or self._holds(name, arrived.get(name)) for name in POSES_FILES)

    def _holds(self, name: str, known: Input | None) -> bool:
        """Whether a file in the result's folder is the one that a manifest tells of."""
        if known is None or not self._there(name):
            return False
        return read_inputs({name: self.path / name}, {name: known})[name].sha256 == known.sha256

    def _unknown(self, manifest: Manifest) -> list[str]:
        """Files with the names of a result's which are none, or not the one that its manifest tells of."""
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
        """Rename poses that are not those of the old manifest: somebody has changed them. Where they are now."""
        manifest, aside = _readable(self.path), []
        for name in self._unknown(manifest) if manifest is not None else ():
            places = (self.path / f"{name}.changed{number or ''}" for number in range(1000))
            aside.append(next(place for place in places if not os.path.lexists(place)))
            os.rename(self.path / name, aside[-1])
        return aside


def _is_own(file: Path) -> bool:
    """Whether a file with the name of poses holds poses; a recording is somebody's, whatever else is in it."""
    return not file.is_symlink() and is_ours(file) and not (file.suffix == ".npz" and holds_silhouettes(file))


def _readable(folder: Path) -> Manifest | None:
    try:
        return read_manifest(folder / MANIFEST_FILE)
    except ValueError:
        return None
