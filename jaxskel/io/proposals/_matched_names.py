"""Matches views to cameras by their names."""

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Match:
    """Which camera each view belongs to.

    Attributes:
        cameras: Name of the camera of each matched view.
        by_order: Whether only the order tells which camera belongs to which view.
        without_camera: Views that belong to no camera.
        without_view: Cameras without a view.
        exact: Whether the names differ only in case, punctuation and leading zeros.
    """

    cameras: dict[str, str]
    by_order: bool = False
    without_camera: tuple[str, ...] = ()
    without_view: tuple[str, ...] = ()
    exact: bool = False


def match_names(views: Sequence[str], cameras: Sequence[str]) -> Match:
    """Match views to cameras.

    Names match if they differ only in case, punctuation and leading zeros, or in the words that all names share, or if
    their numbers match. If there are as many views as cameras and no name tells anything, the order decides.

    Raises:
        ValueError: Why the match is ambiguous, as a part of a line.
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
    """The match of names with equal keys; empty if the key does not distinguish them."""
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
    """Names without the words that all of them begin or end with: `left` of left_mask beside right_mask."""
    parts = [re.split(r"[\W_]+", name) for name in names]
    before = len(os.path.commonprefix(parts))
    after = len(os.path.commonprefix([part[::-1] for part in parts]))
    return _plain(["".join(part[before : len(part) - after]) for part in parts])
