"""File operations that are safe against killed processes and loss of power."""

import os
import re
from contextlib import suppress
from pathlib import Path


def remove_unfinished(path: Path) -> None:
    """Remove temporary files of this file that killed processes have left beside it."""
    left = re.compile(rf"\.{re.escape(path.name)}\.\d+\.part")
    with suppress(FileNotFoundError):
        for file in path.parent.iterdir():
            if left.fullmatch(file.name):
                file.unlink(missing_ok=True)


def to_disk(path: Path) -> None:
    """Wait until a file, or the names in a folder, are safe against a loss of power."""
    folder = path.is_dir()
    if folder and os.name == "nt":  # Windows cannot open folders
        return
    opened = os.open(path, os.O_RDONLY if folder else os.O_RDWR)
    try:
        os.fsync(opened)
    except OSError:
        if not folder:  # some network disks cannot sync folders
            raise
    finally:
        os.close(opened)
