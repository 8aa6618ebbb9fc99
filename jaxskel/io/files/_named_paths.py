"""Paths that files name, from whatever system they come."""

import os
from pathlib import Path, PureWindowsPath


def named_path(folder: Path, name: str) -> Path:
    """The path that a file in a folder names, relative to this folder.

    What was written on Windows may have backslashes between its parts. Elsewhere these are letters of a name, though
    hardly any name has one: they are taken as such where that name exists.

    Args:
        folder: The folder of the file that holds the name.
        name: The name, as it stands there.
    """
    path = folder / name
    return folder / PureWindowsPath(name).as_posix() if "\\" in name and not os.path.lexists(path) else path
