"""Checks that a file can have been written by this user only, because compiled programs are code that is executed.

On Windows there is no such check: the system itself keeps users' own folders apart.
"""

import os
import stat
import sys
from pathlib import Path

_WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_said = False


def is_private(path: Path) -> bool:
    """Whether a file or folder, and any link to it, belongs to this user and is not writable by others.

    Folders above it are not checked: whoever exchanges it there can only put their own files in its place.
    """
    return _is_own(os.lstat(path)) and _is_own(os.stat(path)) and not _open_to_others(os.stat(path))


def make_private(folder: Path) -> None:
    """Make a folder, and missing ones above it, accessible to this user only.

    Raises:
        OSError: It cannot be made.
    """
    if not folder.is_dir():
        make_private(folder.parent)
        folder.mkdir(mode=0o700, exist_ok=True)


def read_private(path: Path) -> bytes | None:
    """Read a file; return None, with a message, if it is not private to this user.

    Raises:
        OSError: It does not exist or cannot be read.
    """
    # Links are refused, because their targets are elsewhere; so are FIFOs, without waiting for them.
    flags = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with open(os.open(path, flags), "rb") as file:
        found = os.fstat(file.fileno())
        if not _is_own(found) or _open_to_others(found) or not stat.S_ISREG(found.st_mode):
            say_shared(path)
            return None
        return file.read()


def say_shared(path: Path) -> None:
    """Print, once in a process, why compiled programs are not loaded."""
    global _said
    if not _said:
        _said = True
        print(
            f"jaxskel: {path}: belongs to another user, or others may write it, so compiled code is neither loaded "
            f"from there nor kept; take a folder of your own (JAX_COMPILATION_CACHE_DIR), or: chmod -R go-w {path}",
            file=sys.stderr,
        )


def _is_own(found: os.stat_result) -> bool:
    return not hasattr(os, "getuid") or found.st_uid == os.getuid()


def _open_to_others(found: os.stat_result) -> bool:
    return hasattr(os, "getuid") and bool(found.st_mode & _WRITABLE_BY_OTHERS)
