"""Lists folders that hold one file for each camera."""

import os
from collections.abc import Callable
from pathlib import Path

from ..files import fault
from ._text import natural_order

_MOST_FILES = 1000


def sorted_files(folder: Path, *suffixes: str) -> list[Path]:
    """The files of a folder with one of the suffixes, sorted by name, cam_2 before cam_10."""
    files = _sorted(folder, lambda entry: entry.name.lower().endswith(suffixes) and entry.is_file())
    if len(files) > _MOST_FILES:
        raise fault(folder, None, f"holds {len(files)} {' and '.join(suffixes)} files; give a folder with one a camera")
    return files


def sorted_folders(folder: Path) -> list[Path]:
    """The subfolders of a folder, sorted by name, cam_2 before cam_10."""
    return _sorted(folder, lambda entry: entry.is_dir())


def _sorted(folder: Path, chosen: Callable[[os.DirEntry[str]], bool]) -> list[Path]:
    # The folder may also hold a hundred thousand images.
    try:
        with os.scandir(folder) as entries:
            names = [entry.name for entry in entries if chosen(entry)]
    except OSError as error:
        raise fault(folder, None, f"cannot be opened ({error.strerror}); check the path") from None
    return [folder / name for name in sorted(names, key=natural_order)]
