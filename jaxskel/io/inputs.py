"""Which files a recording is read from."""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ._archive import keys_of
from ._view_table import place_of
from .folders import RECORDING_FILE, SUBJECT_FILE

_VIEW_KEYS = ("masks", "images", "plate")


def holds_silhouettes(path: Path) -> bool:
    """Whether an `.npz` file is a sequence file, or is damaged so that nobody knows."""
    try:
        return "silhouettes" in keys_of(path)
    except ValueError:
        return True


def input_paths(recording: Path) -> dict[str, Path]:
    """The files, and folders of files, that a recording is read from, by the names it has for them.

    What is not there is left out, as is all that a damaged `recording.toml` names: to say so is for who reads the
    recording.
    """
    if not recording.is_dir():
        return {recording.name: recording} if recording.is_file() else {}
    try:
        table = tomllib.loads((recording / RECORDING_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        table = {}
    names = (RECORDING_FILE, table.get("calibration"), table.get("subject", SUBJECT_FILE), *_of_views(table))
    paths = {name: place_of(recording, name) for name in names if isinstance(name, str) and "\0" not in name}
    return {name: path for name, path in paths.items() if path.exists()}


def _of_views(table: dict[str, Any]) -> Iterator[Any]:
    views = table.get("views")
    for view in views.values() if isinstance(views, dict) else ():
        if isinstance(view, dict):
            yield from (view.get(key) for key in _VIEW_KEYS)
