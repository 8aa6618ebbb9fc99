"""Reads a view's table in a `recording.toml`: its images, and what in them is the person."""

import os
import reprlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import UInt8

from ...segmentation import Background, Cleaning, backdrop_of, backdrop_of_colour, plate_of
from ..files import check_known, fault, named_path, read_image
from ..views import (
    CutOut,
    Frames,
    ImageFolder,
    MaskArchive,
    Matte,
    Person,
    Video,
    View,
    in_colour,
    is_camera,
    is_image,
    person_text,
    rule_for,
    rule_of,
)

KEYS = (
    "masks", "person", "images", "plate", "median", "backdrop", "camera", "turn", "crop", "scale", "calibrated_size",
    "offset", "fps",
)  # fmt: skip
_BACKGROUNDS = ("plate", "median", "backdrop")
# Number of a recording's own images from which its background is made: a median of more is no better.
_SAMPLES = 50
# No body model has more parts.
_MOST_VALUES = 1000


def read_view(
    path: Path,
    name: str,
    table: Mapping[str, Any],
    fps: float,
    cleaning: Cleaning,
    shadows: bool,
    open_images: Callable[[Path, str, Any], Frames] | None = None,
    may_lack: bool = False,
) -> View:
    """Make a view from its table.

    Args:
        path: The file, for messages; other files are named relative to its folder.
        name: The view's name.
        table: The view's table.
        fps: Frame rate of the recording (frames per second).
        cleaning: How silhouettes that are cut out here are cleaned.
        shadows: Whether shadows on a plate are background.
        open_images: Opens what `images` names; by default `open_frames`.
        may_lack: Whether the masks may lack the values of the person: one of several, who is not seen here.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    where = f"views.{name}."
    for key in table:
        check_known(path, key, KEYS, where)
    if ("masks" in table) == ("images" in table):
        raise fault(path, where[:-1], 'give either masks = "..." or, in colour, images = "..." with a background')
    given = [key for key in _BACKGROUNDS if key in table]
    if "masks" in table:
        if given:
            raise fault(path, f"{where}{given[0]}", "belongs to images; masks need no background")
        frames = open_frames(path, f"{where}masks", table["masks"])
        frames, matte = _masks(path, where, frames, table.get("person"), may_lack)
    else:
        if "person" in table:
            raise fault(path, f"{where}person", "belongs to masks; in images a background tells the person")
        frames = (open_images or open_frames)(path, f"{where}images", table["images"])
        if len(given) != 1:
            told = "comes without a background" if not given else f"comes with {' and '.join(given)}"
            raise fault(path, f"{where}images", f'{told}; give plate = "empty.avi", median = true or backdrop = true')
        try:
            background = _background(path, f"{where}{given[0]}", given[0], table[given[0]], frames, shadows)
        except ValueError as error:
            told = str(error)
            raise error if told.startswith(str(path.parent)) else fault(path, f"{where}{given[0]}", told) from None
        matte: Matte = CutOut(background, cleaning)
    offset = table.get("offset", 0)
    if type(offset) is not int or abs(offset) > 10**9:
        raise fault(path, f"{where}offset", f"is {reprlib.repr(offset)}; give a whole number of images")
    own = rate(path, f"{where}fps", table["fps"], "images per second") if "fps" in table else fps
    return View(name, frames, matte, offset, own / fps)


def _masks(path: Path, where: str, frames: Frames, person: Any, may_lack: bool) -> tuple[Frames, Matte]:
    """A view's masks, and the rule that finds the person in them."""
    rule = rule_of(frames) if person is None else rule_for(frames, person_of(path, f"{where}person", person), may_lack)
    if rule.matte is None:
        told = f"{rule.told}, person = {person_text(rule.person)}" if rule.person else rule.told
        raise fault(path, f"{where}{'masks' if person is None else 'person'}", told)
    return rule.frames, rule.matte


def person_of(path: Path, key: str, value: Any) -> Person:
    """Check the mask values or colours of the person."""
    if isinstance(value, list) and 0 < len(value) <= _MOST_VALUES:
        if all(type(number) is int and 0 <= number <= 65535 for number in value):
            return tuple(value)
        if all(_is_colour(colour) for colour in value):
            return tuple(tuple(colour) for colour in value)
    wanted = "values of the masks, [2, 18], or colours, [[255, 0, 0]]"
    raise fault(path, key, f"is {reprlib.repr(value)}; give {wanted}")


def _is_colour(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(type(v) is int and 0 <= v <= 255 for v in value)


def open_frames(path: Path, key: str, value: Any) -> Frames:
    """Open the images that a value names: a folder, a video, or ``archive.npz:key``.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    if is_camera(value):
        raise fault(path, key, f"is {reprlib.repr(value)}, a camera, which only `jaxskel live` reads; name a file")
    place = place_of(path.parent, text(path, key, value))
    if _is_member(value):
        return MaskArchive(place, value.rpartition(":")[2])
    return ImageFolder(place) if os.path.isdir(place) else Video(place)


def place_of(folder: Path, value: str) -> Path:
    """The file or folder that a value names."""
    return named_path(folder, value.rpartition(":")[0] if _is_member(value) else value)


def _is_member(value: str) -> bool:
    archive, colon, _ = value.rpartition(":")
    return bool(colon) and archive.endswith(".npz")


def text(path: Path, key: str, value: Any) -> str:
    """Check that a value is a non-empty string."""
    if not isinstance(value, str) or not value:
        raise fault(path, key, "is missing; name a file" if value is None else f"is {reprlib.repr(value)}; give text")
    return value


def rate(path: Path, key: str, value: Any, what: str) -> float:
    """Check that a value is a rate (per second)."""
    return number(path, key, value, what, 1e-4, 1e6)


def number(path: Path, key: str, value: Any, what: str, least: float, most: float) -> float:
    """Check that a value is a number between `least` and `most`."""
    if type(value) not in (int, float) or not least <= value <= most:
        told = "is missing" if value is None else f"is {reprlib.repr(value)}"
        raise fault(path, key, f"{told}; give a positive number of {what}, {least:g} to {most:g}")
    return float(value)


def _background(path: Path, where: str, key: str, value: Any, frames: Frames, shadows: bool) -> Background:
    if key == "plate":
        place = named_path(path.parent, text(path, where, value))
        still = is_image(place)
        images = [read_image(place, cv2.IMREAD_COLOR)] if still else _some(open_frames(path, where, value))
        return plate_of(images, shadows)
    if value is True:
        return plate_of(_some(frames), shadows) if key == "median" else backdrop_of(_some(frames))
    if key == "backdrop" and _is_colour(value):
        red, green, blue = value
        return backdrop_of_colour(blue, green, red)
    wanted = (
        "true" if key == "median" else "true, or its colour as it looks in the light, [red, green, blue] of 0 to 255"
    )
    raise fault(path, where, f"is {reprlib.repr(value)}; give {wanted}")


def _some(frames: Frames) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
    """Images spread over the whole view."""
    first, last = frames.span
    for chosen in np.unique(np.linspace(first, last, min(_SAMPLES, last - first + 1)).astype(int)).tolist():
        image = frames.read(chosen)
        if image is not None:
            yield in_colour(image)
