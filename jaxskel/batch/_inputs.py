"""Files as they were when they were read, to know whether they are still the same."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Input:
    """A file, or a folder of files, as it was when it was read."""

    bytes: int
    stamp: str
    """Of names, sizes and times: as long as it is the same, so is the content."""
    sha256: str
    """Of names and contents."""


def read_inputs(paths: Mapping[str, Path], known: Mapping[str, Input] | None = None) -> dict[str, Input]:
    """What files are like now.

    Args:
        paths: The files, and folders of files, each under a name.
        known: What they were like before: where names, sizes and times are those, contents are not read again.

    Raises:
        OSError: A file cannot be read.
    """
    found = {}
    for name, path in paths.items():
        files = sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]
        size, stamp = _stamp(files)
        before = (known or {}).get(name)
        found[name] = before if before and before.stamp == stamp else Input(size, stamp, _content(files))
    return found


def same_contents(one: Mapping[str, Input], other: Mapping[str, Input]) -> bool:
    """Whether two sets of files hold the same under the same names."""
    return {name: each.sha256 for name, each in one.items()} == {name: each.sha256 for name, each in other.items()}


def _stamp(files: list[Path]) -> tuple[int, str]:
    digest, size = hashlib.sha256(), 0
    for file in files:
        state = file.stat()
        size += state.st_size
        digest.update(f"{file.name}\0{state.st_size}\0{state.st_mtime_ns}\0".encode(errors="surrogateescape"))
    return size, digest.hexdigest()[:16]


def _content(files: list[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        with open(file, "rb") as content:
            each = hashlib.file_digest(content, "sha256").hexdigest()
        digest.update(f"{file.name}\0{each}\0".encode(errors="surrogateescape"))
    return digest.hexdigest()
