"""Checks that results do not overlap with their inputs, not even through links or other names of the same place."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from ..io.files import fault
from ..io.recordings import input_paths
from ._folders import ResultFolder
from ._sources import Source

_Key = tuple[object, object]
"""Identity of a path's target: device and inode if it exists, else the parent's identity and a name."""


def check_overlaps(sources: Sequence[Source], output: Path, subject: Path | None = None) -> None:
    """Refuse results that would replace, contain or lie in an input of any recording, or share a folder.

    Links and ``..`` are resolved, and so are names that differ only in case if the disk ignores case.

    Args:
        sources: The recordings.
        output: Folder of the results.
        subject: The subject's file, if one is given for all.

    Raises:
        ValueError: One line that names the recording, the place and the input.
    """
    places = _Places()
    inputs: dict[_Key, Path] = {}
    above: dict[_Key, Path] = {}
    for path in _inputs(sources, subject):
        first, *others = places.chain(path)
        inputs.setdefault(first, path)
        for key in others:
            above.setdefault(key, path)
    results: dict[_Key, Source] = {}
    for source in sources:
        folder = ResultFolder(output, source.name)
        own, *others = places.chain(folder.path)
        met = (
            *(("be", inputs[key]) for key in (own, *map(places.key, folder.files)) if key in inputs),
            *(("hold", above[key]) for key in (own,) if key in above),
            *(("lie in", inputs[key]) for key in others if key in inputs),
        )
        for how, path in met:
            raise fault(
                source.path, None, f"its result, {folder.path}, would {how} {path}, which is an input; choose another "
                "output",
            )  # fmt: skip
        same = results.setdefault(own, source)
        if same is not source:
            raise fault(
                source.path, None, f"its result, {folder.path}, would be in the same place as that of "
                f"{same.path}; rename one of them",
            )  # fmt: skip


def _inputs(sources: Sequence[Source], subject: Path | None) -> Iterator[Path]:
    if subject is not None:
        yield subject
    for source in sources:
        yield source.path
        yield from input_paths(source.path).values()
        if source.listed_in is not None:
            yield source.listed_in


class _Places:
    """The targets of paths, each looked up once."""

    def __init__(self) -> None:
        self._keys: dict[str, _Key] = {}
        self._real: dict[str, str] = {}

    def key(self, path: Path) -> _Key:
        return self._of(self._resolved(path))

    def chain(self, path: Path) -> Iterator[_Key]:
        """Identities of a path and of all folders above it, innermost first."""
        place = Path(self._resolved(path))
        for each in (place, *place.parents):
            yield self._of(str(each))

    def _resolved(self, path: Path) -> str:
        """The real path; that of a folder is looked up once for all its contents."""
        folder = str(path.parent)
        if folder not in self._real:
            self._real[folder] = os.path.realpath(folder)
        place = os.path.join(self._real[folder], path.name)
        return os.path.realpath(place) if path.name == ".." or os.path.islink(place) else place

    def _of(self, real: str) -> _Key:
        if real not in self._keys:
            try:
                state = os.stat(real)
                self._keys[real] = state.st_dev, state.st_ino
            except (OSError, ValueError):
                folder, name = os.path.split(real)
                self._keys[real] = (self._of(folder), name) if folder != real else (real, "")
        return self._keys[real]
