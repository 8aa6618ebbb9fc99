"""Files as they were when they were read, to know whether they are still the same."""

import hashlib
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from ..io.files import fault, open_regular

# Read at once (bytes); after each, whoever waits is told that it goes on.
_BLOCK = 1 << 22


@dataclass(frozen=True)
class Input:
    """A file, or a folder of files, as it was when it was read."""

    bytes: int
    stamp: str
    """Of names, sizes and times: as long as it is the same, so is the content."""
    sha256: str
    """Of names and contents."""


def read_inputs(
    paths: Mapping[str, Path],
    known: Mapping[str, Input] | None = None,
    on_block: Callable[[], None] = lambda: None,
) -> dict[str, Input]:
    """What files are like now.

    Args:
        paths: The files, and folders of files, each under a name.
        known: What they were like before: where names, sizes and times are those, contents are not read again.
        on_block: Called again and again while contents are read.

    Raises:
        ValueError: A file is no regular file, or cannot be opened.
        OSError: A folder or a file cannot be read.
    """
    found = {}
    for name, path in paths.items():
        files = _files(path)
        size, stamp = _stamp(files)
        before = (known or {}).get(name)
        found[name] = before if before and before.stamp == stamp else Input(size, stamp, _content(files, on_block))
    return found


def same_contents(one: Mapping[str, Input], other: Mapping[str, Input]) -> bool:
    """Whether two sets of files hold the same under the same names."""
    return {name: each.sha256 for name, each in one.items()} == {name: each.sha256 for name, each in other.items()}


def moment(paths: Mapping[str, Path]) -> str:
    """A name for the state of files and folders that is another one after any change, even one that is undone.

    Besides names, sizes and times of contents it is made of the times at which a file was last touched in any way,
    renamed for instance: those nobody can set. A folder has them too, for what came and went in it.
    """
    digest = hashlib.sha256()
    for name, path in sorted(paths.items()):
        files = _files(path)
        # A link may lead somewhere else for a while.
        for each in (path, *([path.resolve()] if path.is_symlink() else []), *files):
            state = os.lstat(each) if each is path else os.stat(each)
            told = f"{name}\0{each.name}\0{state.st_size}\0{state.st_mtime_ns}\0{state.st_ctime_ns}\0"
            digest.update(told.encode(errors="surrogateescape"))
    return digest.hexdigest()


def _files(path: Path) -> list[Path]:
    return sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]


def _stamp(files: list[Path]) -> tuple[int, str]:
    digest, size = hashlib.sha256(), 0
    for file in files:
        state = file.stat()
        size += state.st_size
        digest.update(f"{file.name}\0{state.st_size}\0{state.st_mtime_ns}\0".encode(errors="surrogateescape"))
    return size, digest.hexdigest()[:16]


def _content(files: list[Path], on_block: Callable[[], None]) -> str:
    digest = hashlib.sha256()
    for file in files:
        digest.update(f"{file.name}\0{_digest(file, on_block)}\0".encode(errors="surrogateescape"))
    return digest.hexdigest()


def _digest(path: Path, on_block: Callable[[], None]) -> str:
    digest = hashlib.sha256()
    with open_regular(path) as file:
        left = os.fstat(file.fileno()).st_size
        while block := file.read(_BLOCK):
            on_block()
            left -= len(block)
            if left < 0:  # it may grow for ever
                raise fault(path, None, "grows while it is read; wait until it is written, then run again")
            digest.update(block)
    return digest.hexdigest()
