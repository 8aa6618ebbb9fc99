"""Folders that hold one file a camera."""

import os
from pathlib import Path

from .._archive import fault
from ._text import natural_order

_MOST_FILES = 1000


def sorted_files(folder: Path, *suffixes: str) -> list[Path]:
    """Its files with one of the suffixes, in the order of their names, cam_2 before cam_10."""
    files = [path for path in _sorted(folder) if path.suffix.lower() in suffixes and os.path.isfile(path)]
    if len(files) > _MOST_FILES:
        raise fault(folder, None, f"holds {len(files)} {' and '.join(suffixes)} files; give a folder with one a camera")
    return files


def sorted_folders(folder: Path) -> list[Path]:
    """The folders in it, in the same order."""
    return [path for path in _sorted(folder) if os.path.isdir(path)]


def _sorted(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir(), key=lambda path: natural_order(path.name))
    except OSError as error:
        raise fault(folder, None, f"cannot be opened ({error.strerror}); check the path") from None
