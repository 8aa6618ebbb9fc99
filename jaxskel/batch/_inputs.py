"""Records the state of input files when they are read, to detect later changes."""

import hashlib
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from ..io.files import fault, open_regular

# Bytes read at once; progress is reported after each block.
_BLOCK = 1 << 22


@dataclass(frozen=True)
class Input:
    """State of a file, or of a folder of files, when it was read.

    Attributes:
        stamp: Digest of names, sizes and times: if it is the same, the contents are taken to be the same.
        sha256: Digest of names and contents.
    """

    bytes: int
    stamp: str
    sha256: str


def read_inputs(
    paths: Mapping[str, Path],
    known: Mapping[str, Input] | None = None,
    on_block: Callable[[], None] = lambda: None,
) -> dict[str, Input]:
    """The current state of files.

    Args:
        paths: The files, and folders of files, by name.
        known: Their earlier state: if names, sizes and times are the same, contents are not read again.
        on_block: Called repeatedly while contents are read.

    Raises:
        ValueError: A file is not a regular file, or cannot be opened.
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
    """Whether two sets of files have the same names and contents."""
    return {name: each.sha256 for name, each in one.items()} == {name: each.sha256 for name, each in other.items()}


def moment(paths: Mapping[str, Path]) -> str:
    """A digest of the state of files and folders that differs after any change, even one that was undone.

    Besides names, sizes and modification times it uses the times of the last status change (ctime), which also change
    when a file is renamed and cannot be set by the user. That of a folder shows files that were added or removed.
    """
    digest = hashlib.sha256()
    for name, path in sorted(paths.items()):
        files = _files(path)
        # The state of the link itself counts too, because it may have pointed somewhere else for a while.
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
            if left < 0:  # it may grow without end
                raise fault(path, None, "grows while it is read; wait until it is written, then run again")
            digest.update(block)
    return digest.hexdigest()
