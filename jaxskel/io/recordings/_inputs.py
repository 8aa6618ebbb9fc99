"""Which files a recording is read from."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..calibrations import beside
from ..files import MOST_BYTES, keys_of, parse_toml, read_bounded
from ._folders import RECORDING_FILE, SUBJECT_FILE
from ._view_table import place_of

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
        return {recording.name: recording} if recording.exists() else {}
    table = _table(recording / RECORDING_FILE)
    calibration = table.get("calibration")
    names = [RECORDING_FILE, calibration, table.get("subject", SUBJECT_FILE), *_of_views(table)]
    if isinstance(calibration, str):
        names += beside(calibration)
    paths = {name: place_of(recording, name) for name in names if isinstance(name, str) and _is_path(name)}
    return {name: path for name, path in paths.items() if os.path.exists(path)}


def _table(path: Path) -> dict[str, Any]:
    try:
        return parse_toml(path, read_bounded(path, MOST_BYTES, "a recording").decode(), "")
    except ValueError:
        return {}


def _is_path(name: str) -> bool:
    # As for who reads it, an empty name is none; it would be the folder itself.
    return bool(name) and "\0" not in name


def _of_views(table: dict[str, Any]) -> Iterator[Any]:
    views = table.get("views")
    for view in views.values() if isinstance(views, dict) else ():
        if isinstance(view, dict):
            yield from (view.get(key) for key in _VIEW_KEYS)
