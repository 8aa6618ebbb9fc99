"""Where recordings are found: in folders, however they are linked, and by patterns."""

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
    """Whether a text may mean several files."""
    return bool(set(text) & set(_WILD))


def is_recording(folder: Path) -> bool:
    """Whether a folder is a recording; what its `recording.toml` is worth is for who reads it."""
    return os.path.lexists(folder / RECORDING_FILE)


def recordings_below(folder: Path) -> Iterator[tuple[str, Path]]:
    """The recordings of a folder and those below it, with their places in it, ``/`` between folders.

    Hidden ones are left out, and so are archives of something else and the results of a batch. A folder is searched
    once, whatever links lead to it.

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
    """The files and folders that a pattern means, sorted: as `glob`, but a folder is searched once."""
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
    """All that is below a folder and not hidden, and itself: its place, and whether it is a folder.

    What is in recordings is left out. Links to folders come last, so that a folder has its own name.
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
