"""Opens files that may be anything, of any size.

Every file that a user names, or that lies in one of their folders, is opened here. Anything but a regular file is
refused before a byte is read, because reading a FIFO, a terminal or a device may block for ever.
"""

import os
import stat
from pathlib import Path
from typing import BinaryIO

from ._errors import fault

# Largest image (px): a square of 8192 px, twice what the largest video cameras have.
MOST_PIXELS = 2**26
_PAGE = 1 << 16

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a FIFO (named pipe)"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def check_pixels(path: Path, width: int, height: int, key: str | None = None) -> None:
    """Refuse an image size (px) that would fill the memory.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    if width * height > MOST_PIXELS:
        raise fault(
            path, key, f"claims images of {width} x {height} px, more than {MOST_PIXELS} pixels; reduce them, or if it "
            "is damaged, write it again",
        )  # fmt: skip


def check_regular(path: Path) -> None:
    """Refuse anything but a regular file or a link to one, without opening it, for readers that open it themselves.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    try:
        mode = os.stat(path).st_mode
    except OSError as error:
        raise _unopened(path, error) from None
    except ValueError:  # a path with a null character
        raise fault(path, None, "is not a path; check it") from None
    _check_kind(path, mode)


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file, or a link to one, for reading; never block, whatever the path leads to.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    # Opening some devices has side effects, so check first; the descriptor is checked again, since the path may change.
    check_regular(path)
    try:
        file = open(path, "rb", opener=_at_once)
    except OSError as error:
        raise _unopened(path, error) from None
    try:
        _check_kind(path, os.fstat(file.fileno()).st_mode)
    except BaseException:
        file.close()
        raise
    return file


def read_bounded(path: Path, most: int, wanted: str) -> bytes:
    """The content of a file that has at most `most` bytes.

    Args:
        path: The file.
        most: Largest size (bytes); no more is read.
        wanted: What the file should be, for messages.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    with open_regular(path) as file:
        # Allocate for the actual size. Files of /proc state 0.
        there = min(most, max(os.fstat(file.fileno()).st_size, _PAGE))
        try:
            content = file.read(there + 1)
        except (OSError, MemoryError) as error:
            raise _unopened(path, error) from None
    # Some files of /proc look regular, but have nothing to read until something happens.
    if content is None:
        raise fault(path, None, "has nothing to read yet, so it is no regular file; check the path")
    if len(content) > most:
        size = f"{most / 1e6:g} MB" if most >= 1e5 else f"{most} bytes"
        raise fault(path, None, f"is longer than {size}, too long for {wanted}; check the path")
    if len(content) > there:
        raise fault(path, None, "grows while it is read; wait until it is written, then try again")
    return content


def _at_once(path: str, flags: int) -> int:
    # Windows has neither flag.
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0))


def _check_kind(path: Path, mode: int) -> None:
    if not stat.S_ISREG(mode):
        kind = next((name for is_kind, name in _KINDS if is_kind(mode)), "something else")
        raise fault(path, None, f"is {kind}, no regular file; check the path")


def _unopened(path: Path, error: OSError | MemoryError) -> ValueError:
    told = error.strerror if isinstance(error, OSError) else "there is not enough memory"
    return fault(path, None, f"cannot be opened ({told or error}); check the path")
