"""Recognises unsupported layouts of images, and tells how to rearrange them into views."""

import os
import re
import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from ..views import is_image
from ._matched_names import match_names
from ._view_sets import ViewSet

# Largest number of files of a folder that are examined, which is enough to recognise its layout.
_ENOUGH = 2000


def all_in_one(folder: Path, cameras: Sequence[str]) -> str | None:
    """Advice if one folder holds the images of several cameras, such as ``masks/cam1_000000.png``; None otherwise.

    Args:
        folder: Folder to search, with its subfolders.
        cameras: Names of the cameras.
    """
    for place in _folders(folder):
        files = [file for file in sorted(os.listdir(place))[:_ENOUGH] if is_image(place / file)]
        for pattern, is_first in ((r"(.*\D)\d+(\.\w+)", True), (r"\d+([^\d.].*)(\.\w+)", False)):
            found = [match for file in files if (match := re.fullmatch(pattern, file)) is not None]
            names = Counter(match[1].strip("_-. ") for match in found)
            if len(found) < len(files) or len(names) < 2 or not _go_together(list(names), cameras):
                continue
            told, suffix = place.relative_to(folder).as_posix(), found[0][2]
            at = _for_shell(told)
            of_camera, of_frame = r"s/[-_. ]*[0-9]*$//", r"s/.*[^0-9]//"
            if not is_first:
                of_camera, of_frame = r"s/^[0-9]*[-_. ]*//", r"s/[^0-9].*//"
            return (
                f"{told} holds the images of {len(names)} cameras ({', '.join(sorted(names))}) in one folder, and each "
                f'needs a folder of its own; in a shell there: for f in {at}/*{suffix}; do n=$(basename "$f" '
                f'{suffix}); d={at}/$(echo "$n" | sed \'{of_camera}\'); mkdir -p "$d"; mv "$f" "$d/$(echo '
                f'"$n" | sed \'{of_frame}\'){suffix}"; done'
            )
    return None


def folder_of_each_frame(folder: Path, found: ViewSet, cameras: Sequence[str]) -> str | None:
    """Advice if the folders of a set are frames, with one file for each camera; None otherwise.

    Args:
        folder: Folder in which the set was found.
        found: The set.
        cameras: Names of the cameras.
    """
    places = [folder / source for source in found.sources.values()]
    if not all(name.isdigit() or re.search(r"\d$", name) for name in found.sources) or not places[0].is_dir():
        return None
    files = [file for file in sorted(os.listdir(places[0])) if is_image(places[0] / file)]
    if any(not (place / file).is_file() for place in places[:_ENOUGH] for file in files):
        return None
    stems = [os.path.splitext(file)[0] for file in files]
    if not _go_together(stems, cameras):
        return None
    # Frame numbers sometimes equal camera numbers.
    if _go_together(list(found.sources), cameras) and not match_names(stems, cameras).exact:
        return None
    suffix = os.path.splitext(files[0])[1]
    return (
        f"{found.pattern} has a folder for each frame with a file for each camera ({', '.join(stems)}), and each "
        f"camera needs a folder of its own; in a shell there: for f in {_for_shell(found.pattern)}/*{suffix}; do "
        f'd=views/$(basename "$f" '
        f'{suffix}); mkdir -p "$d"; cp "$f" "$d/$(basename "$(dirname "$f")"){suffix}"; done'
    )


def _folders(folder: Path) -> Iterator[Path]:
    """A folder and its subfolders, two levels down."""
    yield folder
    for pattern in ("*", "*/*"):
        yield from sorted(place for place in folder.glob(pattern) if place.is_dir())


def _go_together(names: Sequence[str], cameras: Sequence[str]) -> bool:
    """Whether the names match those of the cameras."""
    try:
        match = match_names(names, cameras)
    except ValueError:
        return False
    return not match.by_order and not match.without_camera


def _for_shell(path: str) -> str:
    """A path quoted for a shell, except for its asterisks."""
    return "/".join(part if part == "*" else shlex.quote(part) for part in path.split("/"))
