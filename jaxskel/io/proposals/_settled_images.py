"""Decides which change of the images makes the silhouettes agree."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from jaxtyping import Float

from ...cameras import Cameras, ImageChange
from ...outlines import ConvexOutline, pairs_of, tangent_misses
from ._size_choices import Choice, Size, choices_for

# A choice wins if another's median miss (px) is larger by this factor and by this much, a difference that pixels alone
# can make, and if chance does not explain the larger misses (standard deviations of the mean ratio).
_CLEARLY, _PIXELS, _SIGMAS = 1.15, 0.03, 2.5
# With fewer tangents than this there is no decision.
_LEAST_TANGENTS = 20
# Epipolar tangent planes of agreeing silhouettes miss each other by less than this share of a person's height, even
# with poor masks and cameras, or by less than this (px).
_AGREEING, _PIXEL = 0.02, 1.0
# Largest number of combinations of choices for groups of views, so that the search stays short.
_MOST_COMBINATIONS = 60
# Steps of the search for a better crop than a choice has, as shares of the image size.
_STEPS = (0.04, 0.02, 0.01, 0.005)
_AS_THEY_ARE = Choice("as they are", ImageChange())
_WRONG = (
    Choice("turned by 180 degrees", ImageChange(turn=180)),
    Choice("mirrored", ImageChange(), mirrored=True),
    Choice("upside down and mirrored", ImageChange(turn=180), mirrored=True),
)
Misses = Float[np.ndarray, "pairs frames 2"]


@dataclass(frozen=True)
class SeenViews:
    """Views of a rig with silhouette outlines of a few frames.

    Attributes:
        cameras: The rig as it was calibrated.
        calibrated: Sizes of the calibrated images (px).
        images: Sizes of their images now (px).
        outlines: Convex outlines by frame and view, in the images as they are (px).
    """

    cameras: Cameras
    calibrated: Sequence[Size]
    images: Sequence[Size]
    outlines: Mapping[tuple[int, int], ConvexOutline]

    def misses(self, choices: Sequence[Choice], asked: Collection[int]) -> Misses:
        """Misses of the tangents of the views in question (px), if the images were changed by these choices."""
        moved = {
            (frame, view): choices[view].in_calibrated(outline, self.images[view], self.calibrated[view])
            for (frame, view), outline in self.outlines.items()
        }
        misses = tangent_misses(self.cameras, moved, 1 + max((frame for frame, _ in moved), default=0))
        # Masks err by pixels of the actual images.
        scales = np.array([np.mean(choice.change.scale) for choice in choices])
        pairs = np.array(pairs_of(len(self.cameras)))
        misses *= scales[pairs].mean(1)[:, None, None]
        return misses[np.isin(pairs, list(asked)).any(1)]

    @property
    def agreeing(self) -> float:
        """Silhouettes that agree miss each other by less than this (px)."""
        heights = [np.ptp(outline.uv, axis=0).max() for outline in self.outlines.values()]
        return max(_PIXEL, _AGREEING * float(np.median(heights or [0.0])))


@dataclass(frozen=True)
class Settled:
    """The change of the images of each view.

    Attributes:
        told: The evidence, with figures; empty if nothing was changed.
        doubt: What is wrong in spite of it.
    """

    choices: Sequence[Choice]
    told: str
    doubt: str = ""


def settled(seen: SeenViews) -> Settled:
    """Decide how images were changed that differ in size from the calibrated ones.

    Views with the same two sizes have the same change. The silhouettes of all frames decide together, and must do so
    clearly. Choices with nearly the same effect need not be distinguished, and a usual choice wins over unusual ones.

    Raises:
        ValueError: Why there is no decision, as a part of a line.
    """
    groups: dict[tuple[Size, Size], list[int]] = {}
    for view, (calibrated, image) in enumerate(zip(seen.calibrated, seen.images, strict=True)):
        if calibrated != image:
            groups.setdefault((calibrated, image), []).append(view)
    asked = [view for views in groups.values() for view in views]
    # Likeliest combinations first.
    tried = [(chosen, seen.misses(chosen, asked)) for chosen in _combinations(groups, len(seen.cameras))]
    told = {
        id(chosen): ", ".join(dict.fromkeys(chosen[views[0]].told for views in groups.values())) for chosen, _ in tried
    }
    scores = [_median(misses) for _, misses in tried]
    if not np.isfinite(min(scores)):
        raise ValueError("silhouettes that would tell what was done to them are too few")
    best, least = tried[int(np.argmin(scores))]
    if min(scores) >= seen.agreeing:
        raise ValueError(f"whatever was done to them, silhouettes miss each other by {min(scores):.2g} px and more")
    equal = [(chosen, misses) for chosen, misses in tried if not _is_clear(least, misses)]
    usual = [each for each in equal if all(each[0][view].usual for view in asked)]
    alike = [each for each in equal if _are_alike(seen, best, each[0])]
    if len(alike) < len(equal) and not usual:
        other, more = next(each for each in equal if not any(each is one for one in alike))
        raise ValueError(
            f"silhouettes agree about equally if they are {told[id(best)]} ({min(scores):.2g} px) or "
            f"{told[id(other)]} ({_median(more):.2g} px)"
        )
    chosen, misses = (usual or alike)[0]
    if not usual:
        _check_crop(seen, chosen, misses, asked)
    others = [_median(more) for other, more in tried if not _are_alike(seen, chosen, other)]
    following = f", with the next choice by {min(others):.2g} px" if np.isfinite(min(others, default=np.inf)) else ""
    return Settled(chosen, f"{told[id(chosen)]}: silhouettes miss each other by {_median(misses):.2g} px{following}")


def stated(seen: SeenViews, change: ImageChange, views: Collection[int]) -> Settled:
    """The change of some views as the user states it."""
    choice = Choice("as stated", change)
    chosen = [choice if view in views else _AS_THEY_ARE for view in range(len(seen.cameras))]
    miss = _median(seen.misses(chosen, views))
    known = np.isfinite(miss)
    told = f"as stated; silhouettes miss each other by {miss:.2g} px" if known else "as stated"
    return Settled(chosen, told, "silhouettes do not agree then" if known and miss >= seen.agreeing else "")


def turned_or_mirrored(seen: SeenViews) -> Settled:
    """Whether images of the right size are turned by 180 degrees or mirrored, in all views or in one."""
    names = seen.cameras.names
    every, given = range(len(names)), [_AS_THEY_ARE] * len(names)
    before = seen.misses(given, every)
    if not np.isfinite(_median(before)):
        return Settled(given, "", "too few silhouettes to tell whether the views agree")
    for view in [None, *_guilty(before, len(names))]:
        which = "all images" if view is None else f"the images of {names[view]}"
        asked = every if view is None else [view]
        own = seen.misses(given, asked)
        tried = [[wrong if view in (None, other) else _AS_THEY_ARE for other in every] for wrong in _WRONG]
        misses = [seen.misses(chosen, asked) for chosen in tried]
        best = int(np.argmin([_median(each) for each in misses]))
        if not _is_clear(misses[best], own) or _median(misses[best]) >= seen.agreeing:
            continue
        told = (
            f"{which} look {_WRONG[best].told}: silhouettes miss each other by {_median(misses[best]):.2g} px instead "
            f"of {_median(own):.2g} px"
        )
        if _WRONG[best].mirrored:
            return Settled(given, "", f"{told}; no camera sees that, so flip them")
        return Settled(tried[best], told)
    if _median(before) >= seen.agreeing:
        return Settled(given, "", f"silhouettes do not agree: they miss each other by {_median(before):.2g} px")
    return Settled(given, "")


def _combinations(groups: Mapping[tuple[Size, Size], list[int]], views: int) -> Iterator[list[Choice]]:
    """Choices for all views; if there are too many, only those with the same change for all groups."""
    combined = list(product(*(choices_for(*sizes) for sizes in groups)))
    alike = [each for each in combined if len({choice.told for choice in each}) == 1]
    if len(combined) <= _MOST_COMBINATIONS:
        alike += [each for each in combined if len({choice.told for choice in each}) > 1]
    for each in alike:
        chosen = [_AS_THEY_ARE] * views
        for choice, some in zip(each, groups.values(), strict=True):
            for view in some:
                chosen[view] = choice
        yield chosen


def _median(misses: Misses) -> float:
    there = misses[np.isfinite(misses)]
    return float(np.median(there)) if len(there) >= _LEAST_TANGENTS else np.inf


def _is_clear(best: Misses, other: Misses) -> bool:
    """Whether the misses of another choice are clearly larger."""
    if not _median(other) > _CLEARLY * _median(best) + _PIXELS:
        return False
    both = np.isfinite(best) & np.isfinite(other)
    if both.sum() < _LEAST_TANGENTS:
        return not bool(np.isfinite(_median(other)))
    # Logarithms, because blobs in a mask make misses of any size.
    ratios = np.log((other[both] + _PIXELS) / (best[both] + _PIXELS))
    # Errors of one silhouette affect its tangents with all others. So only as many of the n (n - 1) / 2 pairs of n
    # views are independent as there are silhouette sides.
    views = (1 + np.sqrt(1 + 8 * len(best))) / 2
    independent = both.sum() * min(1.0, views / len(best))
    return bool(ratios.mean() * np.sqrt(independent) > _SIGMAS * ratios.std())


def _are_alike(seen: SeenViews, one: Sequence[Choice], other: Sequence[Choice]) -> bool:
    sizes = zip(one, other, seen.images, seen.calibrated, strict=True)
    return all(a.is_alike(b, image, calibrated) for a, b, image, calibrated in sizes)


def _check_crop(seen: SeenViews, chosen: Sequence[Choice], misses: Misses, asked: Sequence[int]) -> None:
    """Refuse a choice if another crop is clearly better: then all choices were wrong, and this one was the least wrong.

    Raises:
        ValueError: The better crop, as a part of a line.
    """

    def shifted(x: float, y: float) -> list[Choice]:
        moved = list(chosen)
        for view in asked:
            change, (width, height) = chosen[view].change, seen.calibrated[view]
            crop = change.crop[0] + x * width, change.crop[1] + y * height
            moved[view] = replace(chosen[view], change=replace(change, crop=crop))
        return moved

    best, at = misses, (0.0, 0.0)
    for step in _STEPS:
        places = [(at[0] + x * step, at[1] + y * step) for x, y in ((-1, 0), (1, 0), (0, -1), (0, 1))]
        tried = [seen.misses(shifted(*place), asked) for place in places]
        least = int(np.argmin([_median(each) for each in tried]))
        if _median(tried[least]) < _median(best):
            best, at = tried[least], places[least]
    better = shifted(*at)
    if _is_clear(best, misses) and not _are_alike(seen, chosen, better):
        x, y = better[asked[0]].change.crop
        raise ValueError(
            f"silhouettes agree best ({_median(best):.2g} px) if the crop of {seen.cameras.names[asked[0]]} is about "
            f"[{x:.0f}, {y:.0f}], which is neither the middle nor a side"
        )


def _guilty(misses: Misses, views: int) -> list[int]:
    """Views whose tangents miss by far more than those of the other views among each other."""
    pairs = np.array(pairs_of(views))
    found = []
    for view in range(views):
        own, others = (misses[mine] for mine in ((pairs == view).any(1), (pairs != view).all(1)))
        if _median(own) > 2 * _median(others):
            found.append(view)
    return found
