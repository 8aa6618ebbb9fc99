"""Which recordings a batch is made of, and where each one's result goes."""

import glob
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from ..io._bounded import read_bounded
from ..io.folders import RECORDING_FILE
from ..io.inputs import holds_silhouettes

_WILD = "*?["
_LONGEST_LIST = 100_000_000  # bytes: a million long paths


@dataclass(frozen=True)
class Source:
    """A recording of a batch."""

    name: str
    """Of its result, a folder: unique in the batch, with ``/`` where recordings were found in a folder's folders."""
    path: Path
    """The sequence file, or the recording's folder."""


def find_sources(inputs: Iterable[str | Path]) -> list[Source]:
    """Find the recordings that are meant, sorted by name.

    Args:
        inputs: Each a sequence file, a recording's folder, a folder with recordings anywhere below it, a pattern with
            ``*``, or a text file with one of these a line (``#`` begins a comment). What is found below a folder is
            named by its place there, all else by its own name.

    Raises:
        ValueError: Something is not there, no recording is found, or two results would have the same name.
    """
    found: dict[str, Source] = {}
    for each in inputs:
        for source in _below(str(each)):
            same = found.setdefault(source.name, source)
            if same.path.absolute() != source.path.absolute():
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


def _below(given: str) -> Iterator[Source]:
    path = Path(given)
    if not path.exists():
        if not set(given) & set(_WILD):
            raise ValueError(f"{path}: there is no such file or folder; check the path")
        matches = sorted(glob.glob(given, recursive=True))
        if not matches:
            raise ValueError(f"{given}: matches nothing; check the pattern")
        for match in matches:
            yield from _below(match)
    elif path.is_dir() and not (path / RECORDING_FILE).is_file():
        yield from _in_folder(path)
    elif path.is_dir() or path.suffix == ".npz" or path.name == RECORDING_FILE:
        yield _source(path)
    else:
        yield from _listed(path)


def _source(path: Path) -> Source:
    folder = path.parent if path.name == RECORDING_FILE else path
    return Source(folder.absolute().name.removesuffix(".npz"), folder)


def _in_folder(folder: Path, above: str = "") -> Iterator[Source]:
    """The recordings of a folder and those below it; hidden ones are skipped, and archives of something else."""
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        name = above + path.name.removesuffix(".npz")
        if path.is_dir():
            is_one = (path / RECORDING_FILE).is_file()
            yield from [Source(name, path)] if is_one else _in_folder(path, f"{name}/")
        elif path.suffix == ".npz" and holds_silhouettes(path):
            yield Source(name, path)


def _listed(path: Path) -> Iterator[Source]:
    """The recordings of a list; one that is not there is for the batch to report."""
    try:
        lines = read_bounded(path, _LONGEST_LIST, "a list of recordings").decode().splitlines()
    except UnicodeDecodeError:
        raise ValueError(f"{path}: is no sequence file (.npz), and no list of recordings: it is not text") from None
    for line in lines:
        entry = line.partition("#")[0].strip()
        if not entry:
            continue
        place = path.parent / entry
        yield from _below(str(place)) if place.exists() or set(entry) & set(_WILD) else [_source(place)]
