"""Files that only this user can have written: compiled programs are code, and are loaded from nowhere else.

Where the system knows no owners (Windows), the user's own folders are kept apart by the system itself.
"""

import os
import stat
import sys
from pathlib import Path

_WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_said = False


def is_private(path: Path) -> bool:
    """Whether a file or folder, and a link that leads to it, is this user's, and nobody else may write it.

    Folders above it do not matter: others could exchange it there, but only for what is theirs.
    """
    return _is_own(os.lstat(path)) and _is_own(os.stat(path)) and not _open_to_others(os.stat(path))


def make_private(folder: Path) -> None:
    """Make a folder where it is missing, and the missing ones above it, for this user only.

    Raises:
        OSError: It cannot be made.
    """
    if not folder.is_dir():
        make_private(folder.parent)
        folder.mkdir(mode=0o700, exist_ok=True)


def read_private(path: Path) -> bytes | None:
    """The content of a file of this user's own; None where there is none, or where it is not, which is said.

    Raises:
        OSError: It cannot be read.
    """
    # A link in a folder of one's own is none of what is written there. Nor is a FIFO, which would be waited for.
    flags = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    with open(os.open(path, flags), "rb") as file:
        found = os.fstat(file.fileno())
        if not _is_own(found) or _open_to_others(found) or not stat.S_ISREG(found.st_mode):
            say_shared(path)
            return None
        return file.read()


def say_shared(path: Path) -> None:
    """Say why compiled programs are not loaded, once in a process."""
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
