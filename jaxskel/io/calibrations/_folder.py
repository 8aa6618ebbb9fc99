"""Folders that hold one file a camera."""

import os
from collections.abc import Callable
from pathlib import Path

from ..files import fault
from ._text import natural_order

_MOST_FILES = 1000


def sorted_files(folder: Path, *suffixes: str) -> list[Path]:
    """Its files with one of the suffixes, in the order of their names, cam_2 before cam_10."""
    files = _sorted(folder, lambda entry: entry.name.lower().endswith(suffixes) and entry.is_file())
    if len(files) > _MOST_FILES:
        raise fault(folder, None, f"holds {len(files)} {' and '.join(suffixes)} files; give a folder with one a camera")
    return files


def sorted_folders(folder: Path) -> list[Path]:
    """The folders in it, in the same order."""
    return _sorted(folder, lambda entry: entry.is_dir())


def _sorted(folder: Path, chosen: Callable[[os.DirEntry[str]], bool]) -> list[Path]:
    # There may be a hundred thousand images beside them.
    try:
        with os.scandir(folder) as entries:
            names = [entry.name for entry in entries if chosen(entry)]
    except OSError as error:
        raise fault(folder, None, f"cannot be opened ({error.strerror}); check the path") from None
    return [folder / name for name in sorted(names, key=natural_order)]
