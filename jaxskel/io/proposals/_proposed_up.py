"""The axis that points up: what a format says by its habit is held against the cameras, which people mount upright."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...cameras import Cameras, upright
from ...recording import UP_AXES
from ..calibrations import Contents

# A ring of cameras that look level has 1 here, one that looks down by 60 degrees a half, and one of which half the
# cameras stand on their heads 0.
_CLEAR = 0.5
# What contradicts the cameras by no more than this is no contradiction: they look down steeply.
_AGREES = 0.25
# Formats whose files state the axis themselves; all others have a habit.
_STATING = ("sequence file", "FreeMoCap TOML")


@dataclass(frozen=True)
class ProposedUp:
    """An axis for a `recording.toml`."""

    axis: str
    comment: str = ""
    """What is to be checked about it."""
    doubts: tuple[str, ...] = ()


def proposed_up(source: str, contents: Contents, cameras: Sequence[Cameras]) -> ProposedUp:
    """Choose the axis that points up.

    Args:
        source: The calibration's name, for messages.
        contents: What it says.
        cameras: The rig as it was calibrated and as its images are now. Images were turned either because the cameras
            are mounted so, or by mistake: it stands upright where they are more alike.
    """
    direction = max((upright(each) for each in cameras), key=lambda mean: round(float(np.linalg.norm(mean)), 3))
    along = {axis: float("+-".find(axis[0]) * -2 + 1) * float(direction["XYZ".index(axis[1])]) for axis in UP_AXES}
    seen = max(along, key=lambda axis: along[axis])
    is_clear = along[seen] > _CLEAR
    told = contents.up
    if told is None:
        if is_clear:
            return ProposedUp(
                seen,
                "the calibration does not say it; the cameras stand so",
                (f"{source} does not say which axis points up: {seen} is written, because the cameras stand so",),
            )
        return ProposedUp(
            "+Z",
            "the calibration does not say it, nor do the cameras",
            (f"{source} does not say which axis points up, nor do the cameras: +Z is written",),
        )
    if along[told] >= _AGREES:
        return ProposedUp(told)
    if not is_clear:
        doubt = f"the cameras do not tell whether {told} points up, as {source} has it: they do not stand alike"
        return ProposedUp(told, "the cameras do not tell whether it is so", (doubt,))
    if contents.format in _STATING:
        return ProposedUp(
            told, f"the cameras stand as if {seen} pointed up",
            (f"{source} says that {told} points up, but the cameras stand as if {seen} did",),
        )  # fmt: skip
    return ProposedUp(
        seen, f"{told} is usual for {contents.format}, but the cameras stand as if {seen} pointed up",
        (f"{told} is usual for {contents.format}, but the cameras stand as if {seen} pointed up: {seen} is written",),
    )  # fmt: skip
