"""Sets of views in a folder: files or folders that differ in one part of their path, the camera's name."""

import os
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ._archive import keys_of, shape_of
from .views import VIDEO_SUFFIXES, is_image

# Folders in folders are looked through down to here; nobody keeps a camera's images deeper.
_DEPTH = 3
_MASKS = re.compile(r"mask|silh|matte|alpha|segment|binary|foreground", re.IGNORECASE)
_BACKGROUND = re.compile(r"backg|plate|empty|clean|bg(?![a-z])", re.IGNORECASE)
_CALIBRATION = re.compile(r"checker|chess|board|calib|charuco|intrinsic|extrinsic", re.IGNORECASE)


@dataclass(frozen=True)
class ViewSet:
    """Views that belong together."""

    pattern: str
    """Their paths relative to the folder, with ``*`` where the camera's name stands."""
    sources: dict[str, str]
    """What each camera's images are, as a `recording.toml` names it, by the camera's name."""

    @property
    def is_of_masks(self) -> bool:
        """Whether their name says that they are masks."""
        return _MASKS.search(self.pattern) is not None

    @property
    def is_background(self) -> bool:
        """Whether their name says that they show the scene without the person."""
        return _BACKGROUND.search(self.pattern) is not None

    @property
    def is_accessory(self) -> bool:
        """Whether their name says that they are made to prepare the others."""
        return self.is_background or _CALIBRATION.search(self.pattern) is not None


def find_view_sets(folder: Path) -> list[ViewSet]:
    """All sets of at least two views, in the order of their patterns."""
    sets: dict[str, dict[str, str]] = defaultdict(dict)
    for text in sorted(_sources(folder), key=_natural):
        path, colon, key = text.partition(".npz:")
        if colon:
            sets[f"{path}.npz:*"][key] = text
            continue
        parts = text.split("/")
        for place, part in enumerate(parts):
            is_file = place == len(parts) - 1 and (folder / text).is_file()
            name, suffix = os.path.splitext(part) if is_file else (part, "")
            sets["/".join([*parts[:place], f"*{suffix}", *parts[place + 1 :]])][name] = text
    return [ViewSet(pattern, sources) for pattern, sources in sorted(sets.items()) if len(sources) > 1]


def _sources(folder: Path) -> Iterator[str]:
    """Folders of images, videos and arrays of archives, as a `recording.toml` names them."""
    for place, folders, files in os.walk(folder, followlinks=True):
        here = Path(place)
        depth = len(here.relative_to(folder).parts)
        folders[:] = [] if depth >= _DEPTH else sorted(name for name in folders if not name.startswith("."))
        text = here.relative_to(folder).as_posix()
        if depth and any(is_image(here / file) for file in files):
            yield text
        for file in files:
            path = (here / file).relative_to(folder).as_posix()
            if file.startswith("."):
                continue
            if path.lower().endswith(VIDEO_SUFFIXES):
                yield path
            elif path.endswith(".npz"):
                yield from (f"{path}:{key}" for key in _keys_of_masks(here / file))


def _keys_of_masks(path: Path) -> list[str]:
    """Arrays of an archive that may be a camera's masks; none where it is damaged."""
    try:
        shapes = {key: shape_of(path, key) for key in keys_of(path)}
    except ValueError:
        return []
    return [key for key, shape in shapes.items() if len(shape) == 3 and min(shape) > 3]


def _natural(text: str) -> list[tuple[int, str]]:
    """Numbers in the order that people count in."""
    return [(int(part), "") if part.isdigit() and len(part) < 10 else (-1, part) for part in re.split(r"(\d+)", text)]
