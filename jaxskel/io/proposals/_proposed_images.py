"""Decides how the images of each view were changed after calibration, and the `recording.toml` lines that state it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...cameras import Cameras, ImageChange, with_images_changed
from ...outlines import ConvexOutline, convex_outline
from ..calibrations import validated
from ..files import fault
from ..recordings import RECORDING_FILE, missing_sizes
from ..views import Video, View
from ._found_inputs import Found
from ._settled_images import SeenViews, Settled, settled, stated, turned_or_mirrored

# Frames to sample: spread over all frames; for videos over this many first ones, since decoding starts at the front.
_SAMPLES, _OF_VIDEO = 12, 300


@dataclass(frozen=True)
class ProposedImages:
    """The lines of a `recording.toml` on the images, and the cameras that follow from them.

    Attributes:
        lines: Lines for each view.
        calibrated: The rig as it was calibrated.
        cameras: The rig that matches the images.
    """

    lines: dict[str, list[str]]
    doubts: tuple[str, ...]
    calibrated: Cameras
    cameras: Cameras


def proposed_images(
    path: Path, found: Found, views: Sequence[View], frames: tuple[int, int], given: ImageChange | None
) -> ProposedImages:
    """Decide how the images of each view were changed.

    Args:
        path: The `recording.toml`.
        found: The inputs that it will name.
        views: The views that it will name.
        frames: First and last frame.
        given: Change stated by the user, for all images that differ in size from the calibrated ones, or if none does,
            for all images.

    Raises:
        ValueError: One line, if sizes differ and the change remains unknown.
    """
    entries = {entry.name: entry for entry in found.contents.entries}
    names = [found.cameras[view.name] for view in views]
    images = [(float(view.frames.size[0]), float(view.frames.size[1])) for view in views]
    calibrated = [entries[name].size or image for name, image in zip(names, images, strict=True)]
    unknown = missing_sizes(found.contents, names, images)
    rig = validated(path.parent / found.calibration, found.contents, found.contents.unit or 1.0, unknown).cameras
    rig = rig[[rig.names.index(name) for name in names]]
    outlines, doubts = _outlines(views, frames)
    seen = SeenViews(rig, calibrated, images, outlines)
    done = _settled(path, seen, [view.name for view in views], given)
    if done.doubt:
        doubts.append(done.doubt)
    lines: dict[str, list[str]] = {}
    written: dict[str, list[str]] = {}
    for view, choice, image, size in zip(views, done.choices, images, calibrated, strict=True):
        own = choice.lines(image, size)
        lines[view.name] = [f"{line}  # CHECK: {done.told}" for line in own[:1]] + own[1:]
        if own:
            sizes = f"images are {image[0]:g} x {image[1]:g} px, calibrated are {size[0]:g} x {size[1]:g}"
            written.setdefault(f"{sizes}; {', '.join(own)} is written: {done.told}", []).append(view.name)
    doubts += [f"{', '.join(alike)}: {told}" for told, alike in written.items()]
    cameras = with_images_changed(
        rig,
        [choice.change for choice in done.choices],
        calibrated,
        np.array([view.frames.size for view in views]),
    )
    return ProposedImages(lines, tuple(doubts), rig, cameras)


def _settled(path: Path, seen: SeenViews, names: Sequence[str], given: ImageChange | None) -> Settled:
    other = [view for view in range(len(names)) if seen.images[view] != seen.calibrated[view]]
    if given is not None:
        return stated(seen, given, other or range(len(names)))
    if not other:
        return turned_or_mirrored(seen)
    try:
        return settled(seen)
    except ValueError as error:
        (width, height), (w, h) = seen.images[other[0]], seen.calibrated[other[0]]
        raise fault(
            path.parent, None,
            f"images of {', '.join(names[view] for view in other)} are {width:g} x {height:g} px, calibrated are "
            f"{w:g} x {h:g}, and {error}; say what was done to them by --turn, --crop X,Y or --scale, which become "
            f"turn, crop and scale in {RECORDING_FILE}",
        ) from None  # fmt: skip


def _outlines(views: Sequence[View], frames: tuple[int, int]) -> tuple[dict[tuple[int, int], ConvexOutline], list[str]]:
    """Convex outlines of some frames, by frame and view, and reasons for any that are missing."""
    first, last = frames
    if any(isinstance(view.frames, Video) for view in views):
        last = min(last, first + _OF_VIDEO)
    numbers = np.unique(np.linspace(first, last, _SAMPLES).astype(int)).tolist()
    found: dict[tuple[int, int], ConvexOutline] = {}
    try:
        for place, number in enumerate(numbers):
            for index, view in enumerate(views):
                mask = view.silhouette(number)
                outline = convex_outline(np.packbits(mask, axis=-1), mask.shape[1], mask.shape[0])
                if outline is not None:
                    found[place, index] = outline
    except ValueError as error:
        return {}, [str(error)]
    return found, []
