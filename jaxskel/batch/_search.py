"""Finds recordings in folders, also through links, and by patterns."""

import glob
import os
from collections.abc import Iterator
from pathlib import Path

from ..io.files import fault
from ..io.recordings import RECORDING_FILE, holds_silhouettes
from ._manifest import is_manifest
from ._names import MANIFEST_FILE, POSES_FILES

_WILD = "*?["


def is_pattern(text: str) -> bool:
    """Whether a text is a pattern for files."""
    return bool(set(text) & set(_WILD))


def is_recording(folder: Path) -> bool:
    """Whether a folder is a recording; its `recording.toml` is checked only when it is read."""
    return os.path.lexists(folder / RECORDING_FILE)


def recordings_below(folder: Path) -> Iterator[tuple[str, Path]]:
    """The recordings in a folder and below it, with their relative paths, ``/`` between folders.

    Hidden files, archives that are not recordings, and results of a batch are left out. A folder is searched once,
    even if several links lead to it.

    Raises:
        ValueError: A folder cannot be read.
    """
    for name, path, is_folder in _walk(folder):
        if is_folder:
            if name and is_recording(path):
                yield name, path
        elif path.suffix == ".npz" and not _is_result(path) and holds_silhouettes(path):
            yield name.removesuffix(".npz"), path


def matches(pattern: str) -> list[str]:
    """The files and folders that match a pattern, sorted. As `glob`, but each folder is searched once."""
    parts = Path(pattern).parts
    if "**" not in parts:
        return sorted(glob.glob(pattern))
    place = parts.index("**")
    before, after = os.path.join("", *parts[:place]), os.path.join("", *parts[place + 1 :])
    found = set()
    for base in filter(os.path.isdir, glob.glob(before) if before else ["."]):
        for _, path, is_folder in _walk(Path(base)):
            if not after:
                found.add(str(path))
            elif is_folder:
                found.update(matches(os.path.join(glob.escape(str(path)), after)))
    return sorted(found)


def _walk(folder: Path) -> Iterator[tuple[str, Path, bool]]:
    """A folder and everything below it that is not hidden: relative name, path, and whether it is a folder.

    Contents of recordings are left out. Links to folders come last, so that a folder gets its own name, not a link's.
    """
    seen = set()
    here, links = [("", folder)], []
    while here or links:
        name, place = here.pop() if here else links.pop(0)
        try:
            state = os.stat(place)
            if (state.st_dev, state.st_ino) in seen:
                continue
            seen.add((state.st_dev, state.st_ino))
            yield name, place, True
            if name and is_recording(place):
                continue
            for entry in sorted(os.scandir(place), key=lambda entry: entry.name):
                if entry.name.startswith("."):
                    continue
                found = f"{name}/{entry.name}" if name else entry.name, place / entry.name
                if not os.path.isdir(entry):
                    yield *found, False
                else:
                    (links if entry.is_symlink() else here).append(found)
        except OSError as error:
            raise fault(place, None, f"cannot be searched ({error.strerror}); mend that, or give others") from None


def _is_result(path: Path) -> bool:
    return path.name in POSES_FILES and is_manifest(path.with_name(MANIFEST_FILE))
