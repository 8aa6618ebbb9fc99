"""Which camera a view is of, by their names."""

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Match:
    """Views and their cameras."""

    cameras: dict[str, str]
    """The camera of each view that has one."""
    by_order: bool = False
    """Nothing but the order told which is which."""
    without_camera: tuple[str, ...] = ()
    """Views that are of no camera."""
    without_view: tuple[str, ...] = ()
    """Cameras that no view is of."""
    exact: bool = False
    """Names differ in case, signs and leading zeros only."""


def match_names(views: Sequence[str], cameras: Sequence[str]) -> Match:
    """The camera of each view.

    By names that differ in case, signs and leading zeros only, by what names have of their own beside what all have, or
    by numbers in them; by order where views and cameras are as many and names tell nothing.

    Raises:
        ValueError: Why views and cameras cannot be told to go together, a part of a line.
    """
    best = Match({})
    for key in (_plain, _own_part, _digits):
        found = _by(key, views, cameras)
        if len(found.cameras) > len(best.cameras):
            best = found
    if len(best.cameras) >= 2 and 2 * len(best.cameras) > len(views):
        return best
    if len(views) == len(cameras):
        return Match(dict(zip(views, cameras, strict=True)), by_order=True)
    raise ValueError(
        f"there are {len(views)} views, {', '.join(views)}, but {len(cameras)} cameras, {', '.join(cameras)}, and "
        "names do not tell which belong together; name the views as their cameras"
    )


def _by(key: Callable[[Sequence[str]], list[str]], views: Sequence[str], cameras: Sequence[str]) -> Match:
    """The match of those names that are the same by a key; nothing where the key does not tell them apart."""
    known, wanted = key(cameras), key(views)
    if len(set(known)) < len(cameras) or len(set(wanted)) < len(views):
        return Match({})
    of_key = {name: camera for name, camera in zip(known, cameras, strict=True) if name}
    found = {view: of_key[name] for view, name in zip(views, wanted, strict=True) if name in of_key}
    return Match(
        found,
        without_camera=tuple(view for view in views if view not in found),
        without_view=tuple(camera for camera in cameras if camera not in found.values()),
        exact=key is _plain,
    )


def _plain(names: Sequence[str]) -> list[str]:
    return [re.sub(r"0*(\d+)", r"\1", re.sub(r"[\W_]", "", name.lower())) for name in names]


def _digits(names: Sequence[str]) -> list[str]:
    return [" ".join(digits.lstrip("0") or "0" for digits in re.findall(r"\d+", name)) for name in names]


def _own_part(names: Sequence[str]) -> list[str]:
    """What is left of names without what all begin or end with, up to a sign: left_mask and right_mask."""
    parts = [re.split(r"[\W_]+", name) for name in names]
    before = len(os.path.commonprefix(parts))
    after = len(os.path.commonprefix([part[::-1] for part in parts]))
    return _plain(["".join(part[before : len(part) - after]) for part in parts])
