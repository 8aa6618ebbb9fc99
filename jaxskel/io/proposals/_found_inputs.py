"""Finds the inputs in a folder: a calibration, the views that belong to its cameras, and what their images show."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np

from ..calibrations import Contents, contents_of
from ..files import fault, quoted
from ..recordings import RECORDING_FILE, SUBJECT_FILE, open_frames, sequence_files
from ..views import VIDEO_SUFFIXES, Frames, is_image, rule_of
from ._matched_names import Match, match_names
from ._other_layouts import all_in_one, folder_of_each_frame
from ._view_sets import ViewSet, find_view_sets, words_of

# Words in the names of files that people expect to be read as a calibration.
_CALIBRATIONS = frozenset(
    "calib calibration calibrations camera cameras cam cams intri extri intrinsic intrinsics extrinsic extrinsics "
    "rig".split()
)


@dataclass(frozen=True)
class Found:
    """The inputs of a recording, under the names that a `recording.toml` uses.

    Attributes:
        cameras: Name of the camera of each view.
        by_order: Whether only the order tells which camera belongs to which view.
        frames: The images of each view.
        lines: Lines for the TOML table of each view.
    """

    folder: Path
    calibration: str
    contents: Contents
    cameras: Mapping[str, str]
    by_order: bool
    frames: Mapping[str, Frames]
    lines: Mapping[str, list[str]]
    fps: float
    doubts: tuple[str, ...]


def find_inputs(folder: Path, views: str | None, calibration: str | None, fps: float | None) -> Found:
    """Find the inputs of a recording.

    Args:
        folder: Folder to search.
        views: Pattern of the views, if there are several sets.
        calibration: Calibration file relative to the folder, if there are several.
        fps: Frames per second, if no video states it.

    Raises:
        ValueError: As `propose_recording` raises it.
    """
    source, contents, doubts = _calibration(folder, calibration)
    if contents.unit is None:
        doubts.append(f"{source} has no scale, unit = 1 is written: {contents.scale_is}")
    if contents.unposed:
        doubts.append(f"{source}: {', '.join(contents.unposed)} without a pose, left out")
    names = [camera.name for camera in contents.entries]
    chosen, match, others = _views(folder, views, names)
    if match.by_order:
        pairs = ", ".join(f"{view} = {camera}" for view, camera in match.cameras.items())
        doubts.append(f"views and cameras have no names in common: taken in order, {pairs}")
    if match.without_camera:
        doubts.append(f"{source} has no camera for {', '.join(match.without_camera)}: left out")
    if match.without_view:
        doubts.append(f"there is no view of {', '.join(match.without_view)}: the others are used")
    sources = {name: text for name, text in chosen.sources.items() if name in match.cameras}
    if len(sources) < 2:
        raise fault(folder, None, f"{chosen.pattern} has one view of a camera in {source}; at least 2 are needed")
    frames = {name: _opened(folder, name, text) for name, text in sources.items()}
    lines = {name: _view_lines(name, text, frames[name], others, doubts) for name, text in sources.items()}
    rate = fps if fps is not None else _rate(folder, frames)
    return Found(folder, source, contents, match.cameras, match.by_order, frames, lines, rate, tuple(doubts))


def _calibration(folder: Path, wanted: str | None) -> tuple[str, Contents, list[str]]:
    """The calibration's path relative to the folder, its contents, and doubts about the choice."""
    if wanted is not None:
        return wanted, contents_of(folder / wanted), []
    found: dict[str, Contents] = {}
    refused: list[tuple[int, str]] = []
    for path in sorted((folder, *folder.iterdir(), *folder.glob("*/*"))):
        if path.name in (RECORDING_FILE, SUBJECT_FILE) or path.is_dir() and not _may_be_calibration(path):
            continue
        try:
            contents = contents_of(path)
        except ValueError as error:
            refused.append((_unlikely(path), str(error)))
            continue
        if len(contents.entries) > 1:
            found[path.relative_to(folder).as_posix()] = contents
    if not found:
        # Report why the likeliest file was refused; without one, name the folder and the supported formats.
        why = min(refused, key=lambda each: each[0], default=(0, ""))[1]
        raise fault(folder, None, f"holds no calibration that can be read; {why or _refusal(folder)}")
    # A file with all cameras goes before a folder of files, then the file nearest to the top, then TOML, which is the
    # format that people edit.
    order = sorted(
        found, key=lambda text: ((folder / text).is_dir(), text.count("/"), not text.endswith(".toml"), text)
    )
    # One calibration may have several names, such as either file of a pair.
    others = [
        "the files in the folders of the views" if text == "." else text
        for text in order[1:]
        if not _are_same(found[text], found[order[0]])
    ]
    doubts = [f"calibrations {', '.join([order[0], *others])}: the first is taken"] if others else []
    return order[0], found[order[0]], doubts


def _are_same(one: Contents, other: Contents) -> bool:
    return one.format == other.format and all(
        a.name == b.name and all(np.array_equal(getattr(a, key), getattr(b, key)) for key in ("K", "R", "t", "dist"))
        for a, b in zip_longest(one.entries, other.entries, fillvalue=one.entries[0])
    )


def _refusal(path: Path) -> str:
    try:
        contents_of(path)
    except ValueError as error:
        return str(error)
    return "name it by --calibration to see why"


def _unlikely(path: Path) -> int:
    """Rank of how unlikely it is that somebody takes this file for a calibration."""
    if path.is_dir():
        return 2
    suffix = path.suffix.lower()
    if suffix in ("", ".md", ".npz", ".npy", *VIDEO_SUFFIXES) or is_image(path):
        return 3
    return 0 if not _CALIBRATIONS.isdisjoint(words_of(path.name)) else 1


def _may_be_calibration(folder: Path) -> bool:
    """Whether the files of a folder may form one calibration."""
    try:
        names = [file.name.lower() for file in folder.iterdir()]
    except OSError:
        return False
    alike = (".yml", ".yaml", ".xml", ".json", ".calib")
    return any(name == "cameras.txt" or name.endswith(alike) for name in names) or any(folder.glob("*/*.xml"))


def _views(folder: Path, pattern: str | None, cameras: list[str]) -> tuple[ViewSet, Match, list[ViewSet]]:
    """The set of views that belongs to the cameras, the match of views and cameras, and the other sets."""
    sets = find_view_sets(folder)
    if pattern is not None:
        wanted = [found for found in sets if found.pattern == pattern]
        if not wanted:
            raise fault(folder, None, f"--views {pattern}: there are {_listed(sets)}")
        try:
            return wanted[0], match_names(list(wanted[0].sources), cameras), _without(sets, wanted[0])
        except ValueError as error:
            raise fault(folder, None, f"--views {pattern}: {error}") from None
    of_frames = {found.pattern: told for found in sets if (told := folder_of_each_frame(folder, found, cameras))}
    fitting = [
        (found, match)
        for found in sets
        if found.pattern not in of_frames and (match := _matched(found, cameras)) is not None
    ]
    if not fitting:
        told = next(iter(of_frames.values()), None) or all_in_one(folder, cameras)
        raise fault(folder, None, told or _nothing(folder, sets, cameras))
    # In order of certainty: names match cameras one-to-one; then what the images show; then what the names of the sets
    # suggest, which always leaves at least one set.
    shown = {id(found): _shows_masks(folder, found) for found, _ in fitting} if len(fitting) > 1 else {}
    for is_better in (
        lambda found, match: not match.by_order,
        lambda found, match: not match.without_camera,
        lambda found, match: not found.is_accessory,
        lambda found, match: shown[id(found)],
        lambda found, match: found.is_of_masks,
    ):
        better = [each for each in fitting if len(fitting) > 1 and is_better(*each)]
        fitting = better or fitting
    if len(fitting) > 1:
        listed = _listed([found for found, _ in fitting])
        raise fault(folder, None, f"holds several sets of views, {listed}; choose by --views PATTERN")
    chosen, match = fitting[0]
    return chosen, match, _without(sets, chosen)


def _without(sets: list[ViewSet], chosen: ViewSet) -> list[ViewSet]:
    return [found for found in sets if found is not chosen]


def _matched(found: ViewSet, cameras: list[str]) -> Match | None:
    try:
        return match_names(list(found.sources), cameras)
    except ValueError:
        return None


def _nothing(folder: Path, sets: list[ViewSet], cameras: list[str]) -> str:
    """Why no set of views is usable."""
    if not sets and (files := sequence_files(folder)):
        return f"holds {_listed(sets)}; {files[0]} is a recording by itself: give it to `jaxskel run`"
    if len(sets) == 1:
        try:
            match_names(list(sets[0].sources), cameras)
        except ValueError as error:
            return f"{sets[0].pattern}: {error}"
    return f"holds no view for each of {', '.join(cameras)}; there are {_listed(sets)}"


def _listed(sets: list[ViewSet]) -> str:
    return ", ".join(f"{found.pattern} ({', '.join(found.sources)})" for found in sets) or "no images, videos or masks"


def _opened(folder: Path, name: str, text: str) -> Frames:
    return open_frames(folder / RECORDING_FILE, f"views.{name}", text)


def _rate(folder: Path, frames: dict[str, Frames]) -> float:
    rates = {name: view.fps for name, view in frames.items()}
    known = {rate for rate in rates.values() if rate is not None}
    if not known:
        raise fault(folder, None, "nothing says how many frames a second there are; give --fps")
    if max(known) > 1.001 * min(known) or None in rates.values():
        told = ", ".join(f"{name} {rate}" for name, rate in rates.items())
        raise fault(folder, None, f"views have different rates ({told}); give the recording's by --fps")
    return max(known)


def _shows_masks(folder: Path, found: ViewSet) -> bool:
    """Whether the first view of a set has masks; False if it cannot be read or its rule is undecided."""
    name, text = next(iter(found.sources.items()))
    try:
        return rule_of(_opened(folder, name, text)).matte is not None
    except ValueError:
        return False


def _view_lines(name: str, text: str, view: Frames, others: list[ViewSet], doubts: list[str]) -> list[str]:
    """Lines for a view's images: masks, or colour images with the background that is available."""
    doubts += [f"{name}: {note}" for note in view.notes]
    rule = rule_of(view)
    if not rule.is_picture:
        lines = rule.lines()
        doubts += [f"{name}: {rule.told}"] if rule.told else []
        return [f"masks = {quoted(text)}", *lines]
    plate = next((found.sources[name] for found in others if found.is_background and name in found.sources), None)
    if plate is not None:
        return [f"images = {quoted(text)}", f"plate = {quoted(plate)}"]
    doubts.append(
        f"{name}: images are in colour and there is no film of the empty scene: a median over time is written"
    )
    return [
        f"images = {quoted(text)}",
        "median = true  # CHECK: or plate = FILE of the empty scene, or backdrop = true",
    ]
