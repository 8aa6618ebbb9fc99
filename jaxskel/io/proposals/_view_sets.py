"""Finds sets of views in a folder: files or folders that differ in one part of their path, the camera's name."""

import os
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ..files import keys_of, shape_of
from ..views import VIDEO_SUFFIXES, is_image

# Depth of subfolders that are searched, as in session/trial/camera/what/frames.
_DEPTH = 5
# Stacks of arrays up to this side length are camera matrices (3 x 4, 4 x 4), not masks.
_LARGEST_MATRIX = 4
_MASKS = frozenset(
    "mask masks masked silhouette silhouettes sil silh matte mattes alpha seg segment segments segmented segmentation "
    "segmentations binary foreground fg".split()
)
_BACKGROUND = frozenset("background backgrounds backg bg bgs plate plates empty clean cleanplate".split())
_CALIBRATION = frozenset(
    "checker checkers checkerboard checkerboards chess chessboard chessboards board boards calib calibration "
    "calibrations calibrate charuco aruco intrinsic intrinsics intri extrinsic extrinsics extri".split()
)


@dataclass(frozen=True)
class ViewSet:
    """Views that belong together.

    Attributes:
        pattern: Their paths relative to the folder, with ``*`` in place of the camera's name.
        sources: For each camera's name, the source of its images as a `recording.toml` names it.
    """

    pattern: str
    sources: dict[str, str]

    @property
    def is_of_masks(self) -> bool:
        """Whether the name of the set says that it holds masks."""
        return not _MASKS.isdisjoint(words_of(self.pattern))

    @property
    def is_background(self) -> bool:
        """Whether the name of the set says that it shows the scene without the person."""
        return not self.is_of_masks and not _BACKGROUND.isdisjoint(words_of(self.pattern))

    @property
    def is_accessory(self) -> bool:
        """Whether the name of the set says that it only helps to process others (background or calibration)."""
        return self.is_background or not _CALIBRATION.isdisjoint(words_of(self.pattern))


def words_of(text: str) -> list[str]:
    """Lower-case words of a name, split at punctuation, digits, and where a capital follows a small letter."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", text)]


def find_view_sets(folder: Path) -> list[ViewSet]:
    """All sets of at least two views, sorted by pattern."""
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
            # A camera's name may occur twice, as in cam1/cam1_mask.mp4.
            others = [re.sub(rf"(?<![^\W_]){re.escape(name)}(?![^\W_])", "*", other) for other in parts]
            sets["/".join([*others[:place], f"*{suffix}", *others[place + 1 :]])][name] = text
    found: dict[frozenset[str], ViewSet] = {}
    for pattern, sources in sorted(sets.items()):
        if len(sources) > 1:
            found.setdefault(frozenset(sources.values()), ViewSet(pattern, sources))
    return list(found.values())


def _sources(folder: Path) -> Iterator[str]:
    """Folders of images, videos and arrays of archives, as a `recording.toml` names them."""
    reached = set()
    for place, folders, files in os.walk(folder, followlinks=True):
        here = Path(place)
        depth = len(here.relative_to(folder).parts)
        # Do not follow a link to a parent folder again.
        folders[:] = [] if depth >= _DEPTH or here.resolve() in reached else sorted(
            name for name in folders if not name.startswith(".")
        )  # fmt: skip
        reached.add(here.resolve())
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
    """Arrays of an archive that may be the masks of a camera; none if it is damaged."""
    try:
        shapes = {key: shape_of(path, key) for key in keys_of(path)}
    except ValueError:
        return []
    return [key for key, shape in shapes.items() if len(shape) == 3 and min(shape[1:]) > _LARGEST_MATRIX]


def _natural(text: str) -> list[tuple[int, str]]:
    """Sort key that orders numbers by value, not by their digits."""
    return [(int(part), "") if part.isdigit() and len(part) < 10 else (-1, part) for part in re.split(r"(\d+)", text)]
