"""Lists the files that a recording is read from."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..calibrations import beside
from ..files import MOST_BYTES, parse_toml, read_bounded
from ._folders import PERSON_PLACE, RECORDING_FILE, SUBJECT_FILE
from ._view_table import place_of

_VIEW_KEYS = ("masks", "images", "plate")


def input_paths(recording: Path) -> dict[str, Path]:
    """The files, and folders of files, that a recording is read from, by the names that it uses for them.

    Missing files are left out, as are all that a damaged `recording.toml` names; reading the recording reports them.
    """
    if not recording.is_dir():
        return {recording.name: recording} if recording.exists() else {}
    table = _table(recording / RECORDING_FILE)
    calibration = table.get("calibration")
    names = [RECORDING_FILE, calibration, table.get("subject", SUBJECT_FILE), *_of_views(table), *_of_people(table)]
    if isinstance(calibration, str):
        names += beside(calibration)
    paths = {name: place_of(recording, name) for name in names if isinstance(name, str) and _is_path(name)}
    return {name: path for name, path in paths.items() if os.path.exists(path)}


def _table(path: Path) -> dict[str, Any]:
    try:
        return parse_toml(path, read_bounded(path, MOST_BYTES, "a recording").decode("utf-8-sig"), "")
    except ValueError:
        return {}


def _is_path(name: str) -> bool:
    # An empty name counts as missing, as in the reader; it would name the folder itself.
    return bool(name) and "\0" not in name


def _of_views(table: dict[str, Any]) -> Iterator[Any]:
    views = table.get("views")
    for view in views.values() if isinstance(views, dict) else ():
        if isinstance(view, dict):
            yield from (view.get(key) for key in _VIEW_KEYS)


def _of_people(table: dict[str, Any]) -> Iterator[Any]:
    """Subjects of several people, and masks that each has."""
    people = table.get("people")
    for name, person in people.items() if isinstance(people, dict) else ():
        yield person.get("subject") if isinstance(person, dict) else None
        for masks in _of_views(table):
            if isinstance(masks, str) and PERSON_PLACE in masks:
                yield masks.replace(PERSON_PLACE, name)
