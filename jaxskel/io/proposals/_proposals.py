"""Proposes a `recording.toml` for a folder that has none: its views, its calibration and their match."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...cameras import ImageChange
from ..files import fault, parse_toml, quoted
from ..recordings import IN_MEMORY, RECORDING_FILE, SUBJECT_FILE, described_recording, described_span, described_views
from ..views import View
from ._found_inputs import Found, find_inputs
from ._proposed_images import ProposedImages, proposed_images
from ._proposed_up import proposed_up


@dataclass(frozen=True)
class Proposal:
    """The text of a `recording.toml`, and what a person should check in it.

    Attributes:
        doubts: Choices that were made without certainty.
    """

    text: str
    doubts: tuple[str, ...]


def propose_recording(
    folder: Path,
    views: str | None = None,
    calibration: str | None = None,
    fps: float | None = None,
    change: ImageChange | None = None,
) -> Proposal:
    """Write a `recording.toml` for what a folder seems to hold.

    The proposal has been read in the same way as `read_recording` will read it. If images differ in size from the
    calibrated ones, the change is chosen that makes the silhouettes of a few frames agree.

    Args:
        folder: The folder.
        views: Pattern of the views' files or folders relative to it, such as ``masks/*``, if there are several sets.
        calibration: Calibration file relative to it, if there are several.
        fps: Frames per second, if no video states it.
        change: How images that differ in size from the calibrated ones were changed, if the silhouettes do not tell.

    Raises:
        ValueError: One line. There is no calibration or no set of views, or several and no way to choose; or the change
            of images of another size is unknown; or the recording would be refused.
    """
    path = folder / RECORDING_FILE
    found = find_inputs(folder, views, calibration, fps)
    doubts = list(found.doubts)
    offsets = _offsets(found, doubts)
    table = _parsed(path, _Draft(found, offsets).text())
    described = described_views(path, table)
    frames = _frames(path, table, described, doubts)
    images = proposed_images(path, found, described, frames or described_span(path, table, described), change)
    up = proposed_up(found.calibration, found.contents, (images.calibrated, images.cameras))
    doubts += [*images.doubts, *up.doubts]
    text = _Draft(found, offsets, frames, up.axis, up.comment, images).text()
    described_recording(path, _parsed(path, text), described, IN_MEMORY)
    return Proposal(text, tuple(doubts))


@dataclass(frozen=True)
class _Draft:
    """What is known so far of a `recording.toml`."""

    found: Found
    offsets: dict[str, int]
    frames: tuple[int, int] | None = None
    up: str = "+Z"
    told_of_up: str = ""
    images: ProposedImages | None = None

    def text(self) -> str:
        found = self.found
        lines = [
            "# Written by `jaxskel init`. What it had to choose says so; `jaxskel check` draws what comes of it.",
            "",
        ]
        lines += [f"fps = {found.fps:.10g}", f"calibration = {quoted(found.calibration)}"]
        if found.contents.unit is None:
            lines += ["unit = 1.0  # CHECK: metres per unit of the calibration, which has no scale"]
        lines += [f'up = "{self.up}"{_comment(self.told_of_up)}']
        if self.frames is not None:
            first, last = self.frames
            lines += [
                f"frames = [{first}, {last}]  # CHECK: those that all views have; is frame {first} the same moment?"
            ]
        is_known = (found.folder / SUBJECT_FILE).is_file()
        lines += [f'subject = "{SUBJECT_FILE}"' if is_known else _NO_SUBJECT]
        for name, camera in found.cameras.items():
            lines += ["", f"[views.{quoted(name) if re.search(r'[^A-Za-z0-9_-]', name) else name}]"]
            lines += found.lines[name]
            if camera != name:
                lines += [f"camera = {quoted(camera)}" + ("  # CHECK: taken in order" if found.by_order else "")]
            if name in self.offsets:
                lines += [f"offset = {self.offsets[name]}  # CHECK: are the first images of all views the same moment?"]
            if self.images is not None:
                lines += self.images.lines[name]
        return "\n".join(lines) + "\n"


_NO_SUBJECT = f'# subject = "{SUBJECT_FILE}"  # the subject\'s stature and lengths, if known'


def _parsed(path: Path, text: str) -> dict[str, Any]:
    return parse_toml(path, text, f"name files and folders otherwise, or write {RECORDING_FILE} by hand")


def _offsets(found: Found, doubts: list[str]) -> dict[str, int]:
    """Offsets of views whose image numbers do not overlap: the first images are taken for the same frame."""
    spans = {name: frames.span for name, frames in found.frames.items()}
    if max(first for first, _ in spans.values()) <= min(last for _, last in spans.values()):
        return {}
    told = ", ".join(f"{name} {first} to {last}" for name, (first, last) in spans.items())
    doubts.append(f"views have no image numbers in common ({told}): their first images are taken for one moment")
    return {name: first for name, (first, _) in spans.items()}


def _frames(path: Path, table: dict[str, Any], views: Sequence[View], doubts: list[str]) -> tuple[int, int] | None:
    """First and last frame, if the views differ in it; None otherwise."""
    spans = {view.span for view in views}
    if len(spans) == 1:
        return None
    first, last = max(span[0] for span in spans), min(span[1] for span in spans)
    if last < first:
        raise fault(path.parent, None, "the views have no frame in common; check the numbers of their images")
    doubts.append(f"views have different numbers of frames: {first} to {last} are those of all")
    return first, last


def _comment(told: str) -> str:
    return f"  # CHECK: {told}" if told else ""
