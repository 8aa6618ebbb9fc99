"""Keys of a view that state how its images were changed after its camera was calibrated."""

import math
import reprlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...cameras import TURNS, ImageChange
from ..calibrations import Contents
from ..files import fault
from ._view_table import number

Size = tuple[float, float]
# Tolerance of sizes (px): scaled sizes are rounded to whole pixels, by codecs to even ones.
_ROUNDED = 2.0
_LEAST_SCALE, _MOST_SCALE = 1e-3, 1e3
# Largest crop offset (px): no image has more pixels on a side.
_FARTHEST = 65536


def read_change(path: Path, where: str, table: Mapping[str, Any]) -> ImageChange:
    """Read the change of a view's images from its table.

    Args:
        path: The file, for messages.
        where: The table's name with a dot, for messages.
        table: The view's table.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    turn = table.get("turn", 0)
    if type(turn) is not int or turn not in TURNS:
        raise fault(path, f"{where}turn", f"is {reprlib.repr(turn)}; give 90, 180 or 270, degrees clockwise")
    crop = table.get("crop", [0, 0])
    if not (isinstance(crop, list) and len(crop) == 2 and all(_is_offset(n) for n in crop)):
        raise fault(
            path, f"{where}crop", f"is {reprlib.repr(crop)}; give [x, y], where the image's first pixel lies in the "
            "calibrated image (px)",
        )  # fmt: skip
    scale = table.get("scale", 1)
    both = scale if isinstance(scale, list) and len(scale) == 2 else [scale, scale]
    across, down = (
        number(
            path, f"{where}scale", n, "pixels for each calibrated one (or [across, down])", _LEAST_SCALE, _MOST_SCALE
        )
        for n in both
    )
    return ImageChange(turn, (float(crop[0]), float(crop[1])), (across, down))


def calibrated_size(
    path: Path, where: str, table: Mapping[str, Any], image: tuple[int, int], known: Size | None, source: str
) -> Size:
    """Width and height (px) of a view's images when its camera was calibrated.

    Args:
        path: The file, for messages.
        where: The table's name with a dot, for messages.
        table: The view's table.
        image: Width and height of its images now (px).
        known: Size that the calibration states, if any (px).
        source: The calibration's name, for messages.

    Raises:
        ValueError: One line, if the sizes contradict each other and the table does not state the change.
    """
    change = read_change(path, where, table)
    stated = table.get("calibrated_size")
    if stated is not None:
        if not (isinstance(stated, list) and len(stated) == 2 and all(type(n) is int and n > 0 for n in stated)):
            raise fault(path, f"{where}calibrated_size", f"is {reprlib.repr(stated)}; give [width, height]")
        if known is not None and (stated[0], stated[1]) != known:
            raise fault(
                path, f"{where}calibrated_size",
                f"is {stated}, but {source} is for {known[0]:g} x {known[1]:g}; state that or leave it out",
            )  # fmt: skip
        known = float(stated[0]), float(stated[1])
    cut = stated is not None or "crop" in table
    if known is None:
        if "crop" in table and change.turn:
            raise fault(
                path, f"{where}crop", f"comes with turn, but {source} says no size; state calibrated_size = "
                "[width, height]",
            )  # fmt: skip
        size = image[0] / change.scale[0], image[1] / change.scale[1]
        return change.turned_size(size)  # a quarter turn back exchanges width and height too
    whole = change.size_of_all(known)
    if not cut:
        rounded = 0.0 if change.scale == (1.0, 1.0) else _ROUNDED
        if max(abs(whole[0] - image[0]), abs(whole[1] - image[1])) > rounded:
            raise fault(path, where[:-1], _contradiction(change, image, known, whole, source))
    elif not _overlap(change, image, known):
        raise fault(
            path, f"{where}{'crop' if 'crop' in table else 'calibrated_size'}",
            f"the image of {image[0]} x {image[1]} px would show nothing of the calibrated one of {known[0]:g} x "
            f"{known[1]:g}; give where its first pixel lies there, [x, y]",
        )  # fmt: skip
    return known


def missing_sizes(contents: Contents, names: Sequence[str], sizes: Sequence[Size]) -> dict[str, tuple[int, int]]:
    """Whole sizes (px) for cameras whose calibration states none: those of their views, or any if they have no view.

    Args:
        contents: The calibration.
        names: Names of the cameras that have views.
        sizes: Sizes of the calibrated images of these cameras (px).
    """
    known = dict(zip(names, sizes, strict=True))
    found = {entry.name: known.get(entry.name, sizes[0]) for entry in contents.entries if entry.size is None}
    return {name: (max(1, round(width)), max(1, round(height))) for name, (width, height) in found.items()}


def _is_offset(value: Any) -> bool:
    return type(value) in (int, float) and math.isfinite(value) and abs(value) <= _FARTHEST


def _contradiction(change: ImageChange, image: tuple[int, int], known: Size, whole: Size, source: str) -> str:
    told = f"its images are {image[0]} x {image[1]} px, but {source} is for {known[0]:g} x {known[1]:g}"
    if change != ImageChange():
        told += f", which turn and scale make {whole[0]:g} x {whole[1]:g}"
    return (
        f"{told}; state what was done to them: scale = {image[0] / known[0]:.4g} or crop = [x, y] or turn = 90, or "
        f"where they were padded or cut at the right or bottom only, calibrated_size = [{known[0]:g}, {known[1]:g}]"
    )


def _overlap(change: ImageChange, image: tuple[int, int], known: Size) -> bool:
    """Whether the image shows any part of the calibrated image."""
    turned = change.turned_size(known)
    return all(
        first < most and first + length / scale > 0
        for first, most, length, scale in zip(change.crop, turned, image, change.scale, strict=True)
    )
