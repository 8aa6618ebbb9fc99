"""Reads the recordings of several people in one room, each of whom has masks, or mask values, of their own."""

import re
from pathlib import Path
from typing import Any

from ..._runtime.kinds import check_kind
from ...recording import Recording
from ..files import MOST_BYTES, check_known, fault, parse_toml, read_bounded
from ._folders import PERSON_PLACE, RECORDING_FILE, described_recording, described_views, read_table
from ._sequence_file import IN_MEMORY, people_in_file, read_people_file
from ._view_table import person_of

_KEYS = ("person", "subject")
# Names become those of files.
_NAME = r"[A-Za-z0-9][A-Za-z0-9_-]*"


def holds_people(path: str | Path) -> bool:
    """Whether a recording is one of several people who are told apart by their masks; false for what is damaged."""
    return _people_of(Path(path)) is not None


def names_of_people(path: str | Path) -> list[str]:
    """Names of the people who are told apart by their masks; empty if there is one, or what is there is damaged."""
    people = _people_of(Path(path))
    names = list(people) if isinstance(people, dict | list) else []
    return names if all(re.fullmatch(_NAME, name) for name in names) else []


def _people_of(path: Path) -> Any:
    """What a recording says of its people: a table or names; None where there is nothing, or it is damaged."""
    file = path / RECORDING_FILE if path.is_dir() else path
    try:
        if file.name == RECORDING_FILE:
            return parse_toml(file, read_bounded(file, MOST_BYTES, "a recording").decode("utf-8-sig"), "").get("people")
        return (people_in_file(file) or None) if file.suffix == ".npz" else None
    except (OSError, ValueError):
        return None


def read_people(path: str | Path, in_memory: int = IN_MEMORY) -> dict[str, Recording]:
    """Read the recording of each person by name, from a folder whose `recording.toml` has people, or a sequence file.

    What the others hide of each is not in them, see `jaxskel.people.hide_others`.

    Args:
        path: The folder, or the file.
        in_memory: See [`read_recording`][].

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    check_kind("path", path, str | Path, "the path of a file or of a folder")
    path = Path(path)
    if path.is_dir() or path.name == RECORDING_FILE:
        return _in_folder(path / RECORDING_FILE if path.is_dir() else path, in_memory)
    names = people_in_file(path)
    if not names:
        raise fault(path, "silhouettes", "are of one person, or of all; read them with read_recording")
    for name in names:
        _check_name(path, f"silhouettes_{name}", name)
    return read_people_file(path, in_memory)


def _in_folder(path: Path, in_memory: int) -> dict[str, Recording]:
    table = read_table(path)
    people = table.pop("people", None)
    if not isinstance(people, dict) or not people or not all(isinstance(one, dict) for one in people.values()):
        raise fault(path, "people", "is missing; give a table for each person, [people.anna] with person = [1]")
    found = {}
    for name, own in people.items():
        _check_name(path, f"people.{name}", name)
        for key in own:
            check_known(path, key, _KEYS, f"people.{name}.")
        if "person" in own:
            person_of(path, f"people.{name}.person", own["person"])  # refuses what is none
        given = table | {"views": _views_of(path, name, own, table.get("views"))}
        if "subject" in own:
            given["subject"] = own["subject"]
        recording = described_recording(path, given, described_views(path, given, may_lack=True), in_memory)
        found[name] = recording.named(name)
    return found


def _check_name(path: Path, key: str, name: str) -> None:
    if not re.fullmatch(_NAME, name):
        raise fault(path, key, "is no name; give letters, digits, _ and -")


def _views_of(path: Path, name: str, own: dict[str, Any], views: Any) -> Any:
    """The tables of all views, with the masks, or the values of the masks, of one person."""
    if not isinstance(views, dict) or not all(isinstance(view, dict) for view in views.values()):
        return views
    found = {}
    for view, table in views.items():
        masks, where = table.get("masks"), f"views.{view}."
        if not isinstance(masks, str):
            raise fault(path, f"{where}masks", "is missing; people are told apart by masks, so each view needs them")
        if "person" in table:
            raise fault(path, f"{where}person", "belongs to one person; give person in the table of each of the people")
        if ("person" in own) == (PERSON_PLACE in masks):
            raise fault(
                path, f"people.{name}.person",
                f"give either the values of the masks that are {name}, person = [1], or {PERSON_PLACE} in the masks of "
                f'all views, masks = "{PERSON_PLACE}/{view}"',
            )  # fmt: skip
        found[view] = table | {"masks": masks.replace(PERSON_PLACE, name)}
        if "person" in own:
            found[view]["person"] = own["person"]
    return found
