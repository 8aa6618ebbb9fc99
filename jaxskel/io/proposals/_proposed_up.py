"""Chooses the up axis: compares what the format states or implies with the cameras, which people mount upright."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...cameras import Cameras, upright
from ...recording import UP_AXES
from ..calibrations import Contents

# Length of the mean upright of the cameras, along the axis, above which it is clear. Level cameras give 1, cameras that
# look down by 60 degrees 0.5, and a rig with half of its cameras upside down 0.
_CLEAR = 0.5
# A stated axis contradicts the cameras only below this value; cameras that look down steeply come close to it.
_AGREES = 0.25
# Formats whose files state the axis themselves; the others only have a convention.
_STATING = ("sequence file", "FreeMoCap TOML")


@dataclass(frozen=True)
class ProposedUp:
    """An up axis for a `recording.toml`.

    Attributes:
        comment: What a person should check about it.
    """

    axis: str
    comment: str = ""
    doubts: tuple[str, ...] = ()


def proposed_up(source: str, contents: Contents, cameras: Sequence[Cameras]) -> ProposedUp:
    """Choose the axis that points up.

    Args:
        source: Name of the calibration, for messages.
        contents: Contents of the calibration.
        cameras: The rig as calibrated and as its images are now. Images were turned either because the cameras are
            mounted that way, or by mistake; the rig whose cameras agree better on the upright is used.
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
