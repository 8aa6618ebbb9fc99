"""Listings of folders, to see what a command has changed."""

import os
from pathlib import Path


def tree(folder: Path) -> dict[str, object]:
    """All that is in a folder: what files hold, where links lead, and which folders there are."""
    found: dict[str, object] = {}
    for place, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(place, name)
            key = str(path.relative_to(folder))
            if path.is_symlink():
                found[key] = os.readlink(path)
            elif path.is_file():
                found[key] = path.read_bytes()
            else:
                found[key] = "folder" if path.is_dir() else "special"
    return found
