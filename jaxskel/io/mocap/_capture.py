"""The type for motion capture clips, and the checks that their readers share."""

import math
from collections.abc import Sequence
from pathlib import Path

import equinox as eqx
import numpy as np
from jaxtyping import Float

from ..files import read_bounded

# Limits against files that claim more than they hold. The longest clips of the common databases have some 30 joints and
# 23 000 frames.
_MOST_BYTES = 500_000_000
_MOST_JOINTS = 1000
_MOST_POSITIONS = 10_000_000
_GREATEST_NUMBER = 1e9


class Motion(eqx.Module):
    """Joint positions of one clip of motion capture.

    Attributes:
        names: Name of each joint in the file; parents come before their children.
        parents: Index of each joint's parent, -1 for the root.
        positions: Joint positions in the world of the file (m).
        rest: Joint positions with all angles zero, the root at the origin (m).
        fps: Frames per second.
        up: World axis that points up: one of `jaxskel.recording.UP_AXES`.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    parents: tuple[int, ...] = eqx.field(static=True)
    positions: Float[np.ndarray, "frames joints 3"]
    rest: Float[np.ndarray, "joints 3"]
    fps: float
    up: str

    def __len__(self) -> int:
        return len(self.positions)


def read_text(path: Path) -> str:
    """The text of a motion file, as Latin-1: old files hold names in it, and decoding never fails."""
    return read_bounded(path, _MOST_BYTES, "a clip").decode("latin-1")


def to_number(word: str, where: str) -> float:
    """A finite number of a sensible size; otherwise a ValueError that names the place."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not abs(value) < _GREATEST_NUMBER:
        raise ValueError(f"{where}: {word[:40]!r} should be a number of at most 1e9")
    return value


def to_vector(words: Sequence[str], where: str) -> Float[np.ndarray, "3"]:
    """Three finite numbers."""
    if len(words) < 3:
        raise ValueError(f"{where}: three numbers are needed, not {' '.join(words)[:60]!r}")
    return np.array([to_number(word, where) for word in words[:3]])


def check_size(frames: int, joints: int, where: str) -> None:
    """Refuse clips without frames, or so large that they would fill the memory, before anything is allocated."""
    if frames < 1 or joints < 1:
        raise ValueError(f"{where}: the file holds {frames} frames of {joints} joints: it is cut short or not a motion")
    if joints > _MOST_JOINTS or frames * joints > _MOST_POSITIONS:
        raise ValueError(
            f"{where}: {frames} frames of {joints} joints are more than the {_MOST_JOINTS} joints and "
            f"{_MOST_POSITIONS} positions that a clip may have; cut it into parts"
        )


def check_scale(scale: float, fps: float | None = None) -> None:
    """Refuse scales and frame rates that are not positive numbers."""
    if not 0.0 < scale < 1e6:
        raise ValueError(f"scale = {scale}: give metres per unit of the file, such as 0.01 for centimetres")
    if fps is not None and not 0.0 < fps < 1e6:
        raise ValueError(f"fps = {fps}: give the frame rate of the clip")


def turn(axis: str, angle: Float[np.ndarray, " frames"]) -> Float[np.ndarray, "frames 3 3"]:
    """Right-handed rotations about the axis ``x``, ``y`` or ``z`` by an angle (rad)."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    rotation = np.zeros((len(angle), 3, 3))
    rotation[:, i, i] = 1.0
    rotation[:, j, j] = rotation[:, k, k] = np.cos(angle)
    rotation[:, k, j] = np.sin(angle)
    rotation[:, j, k] = -rotation[:, k, j]
    return rotation
