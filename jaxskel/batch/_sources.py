"""The recordings of a batch, and the names of their results."""

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from ..io.files import fault, named_path, read_bounded
from ..io.recordings import RECORDING_FILE, names_of_people
from ._names import check_name
from ._search import is_pattern, is_recording, matches, recordings_below

_LONGEST_LIST = 100_000_000  # bytes: a million long paths


@dataclass(frozen=True)
class Source:
    """A recording of a batch, or one of the people in it.

    Attributes:
        name: Name of its result's folder, unique in the batch; with ``/`` for recordings found in subfolders, and
            before the name of a person.
        path: The sequence file, or the recording's folder.
        listed_in: The list file that names it, if any.
        person: The one of several people, who have masks of their own, that it is; None if there is one.
    """

    name: str
    path: Path
    listed_in: Path | None = None
    person: str | None = None


def find_sources(inputs: Iterable[str | Path]) -> list[Source]:
    """Find the recordings that the inputs name, sorted by name.

    Args:
        inputs: Each a sequence file, a recording's folder, a folder with recordings anywhere below it, a pattern with
            ``*``, or a text file with one of these per line (``#`` begins a comment). A recording found below a folder
            is named by its relative path, any other by its own name. Linked folders are searched once. Each of several
            people who have masks of their own is a source by themselves.

    Raises:
        ValueError: An input does not exist or cannot be read, no recording is found, two results would have the same
            name, or a result would have an invalid name.
    """
    found: dict[str, Source] = {}
    for each in inputs:
        for source in (person for one in _below(str(each), ()) for person in _people_of(one)):
            check_name(source.path, source.name)
            same = found.setdefault(source.name, source)
            if os.path.realpath(same.path) != os.path.realpath(source.path):
                raise ValueError(
                    f"{source.path}: its result would be {source.name}, as that of {same.path}; give a folder that "
                    "holds both, and they are named by their places in it"
                )
    for source in found.values():
        for above in map(str, PurePosixPath(source.name).parents):
            if above in found:
                raise ValueError(
                    f"{found[above].path}: its result would be {above}, a folder that holds that of {source.path}; "
                    "rename one of them"
                )
    if not found:
        raise ValueError("no recording is found: give sequence files (.npz) or folders with a recording.toml")
    return [found[name] for name in sorted(found)]


def _people_of(source: Source) -> Iterator[Source]:
    """A source for each of several people, or the source itself."""
    names = names_of_people(source.path)
    for name in names:
        yield replace(source, name=f"{source.name}/{name}", person=name)
    if not names:
        yield source


def _below(given: str, lists: tuple[Path, ...]) -> Iterator[Source]:
    """The recordings of one input; `lists` are the nested list files that it comes from."""
    path = Path(given)
    listed_in = lists[-1] if lists else None
    try:
        if not given:
            raise ValueError("an input is empty; give the path of a recording")
        if not path.exists():
            if not is_pattern(given):
                raise ValueError(f"{path}: there is no such file or folder; check the path")
            found = matches(given)
            if not found:
                raise ValueError(f"{given}: matches nothing; check the pattern")
            for match in found:
                yield from _below(match, lists)
        elif path.is_dir() and not is_recording(path):
            yield from (Source(name, place, listed_in) for name, place in recordings_below(path))
        elif path.is_dir() or path.suffix == ".npz" or path.name == RECORDING_FILE:
            yield _source(path, listed_in)
        else:
            yield from _listed(path, lists)
    except OSError as error:
        raise fault(path, None, f"cannot be read ({error.strerror}); check the path") from None


def _source(path: Path, listed_in: Path | None) -> Source:
    folder = path.parent if path.name == RECORDING_FILE else path
    # "." and ".." have the name of the folder that they lead to.
    name = folder.name if folder.name not in ("", "..") else folder.resolve().name
    return Source(name.removesuffix(".npz"), folder, listed_in)


def _listed(path: Path, lists: tuple[Path, ...]) -> Iterator[Source]:
    """The recordings of a list file; the batch reports missing ones."""
    if any(path.samefile(other) for other in lists):
        raise fault(path, None, "is a list that names itself; take it out")
    try:
        lines = read_bounded(path, _LONGEST_LIST, "a list of recordings").decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise ValueError(f"{path}: is neither a sequence file (.npz) nor a list of recordings (not text)") from None
    for line in lines:
        entry = line.partition("#")[0].strip()
        if not entry:
            continue
        place = named_path(path.parent, entry)
        if place.exists() or is_pattern(entry):
            yield from _below(str(place), (*lists, path))
        else:
            yield _source(place, path)
