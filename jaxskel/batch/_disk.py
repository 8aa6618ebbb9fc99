"""What a kill or a loss of power leaves of files."""

import os
import re
from contextlib import suppress
from pathlib import Path


def remove_unfinished(path: Path) -> None:
    """Remove what processes that were killed while they wrote this file whole have left beside it."""
    left = re.compile(rf"\.{re.escape(path.name)}\.\d+\.part")
    with suppress(FileNotFoundError):
        for file in path.parent.iterdir():
            if left.fullmatch(file.name):
                file.unlink(missing_ok=True)


def to_disk(path: Path) -> None:
    """Wait until a file, or the names in a folder, would outlast a loss of power."""
    folder = path.is_dir()
    if folder and os.name == "nt":  # which cannot open folders
        return
    opened = os.open(path, os.O_RDONLY if folder else os.O_RDWR)
    try:
        os.fsync(opened)
    except OSError:
        if not folder:  # some network disks cannot, of a folder
            raise
    finally:
        os.close(opened)
