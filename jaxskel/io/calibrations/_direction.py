"""Whether cameras look at something together, or would if their poses were meant in another way.

That x_cam = R x + t is meant by a rotation and three numbers, and not a camera's place or the way back, nothing says in
a file but the habit of its format. Cameras that film one person look at it: where they do not, but all of them would if
the numbers were meant in another way, the file is not taken at its word.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .._archive import fault
from ._calibration import Contents

# Degrees between a camera's axis and the point that all look at. A person fills an image from edge to edge, 35 degrees
# from its middle for a wide lens; what is taken for the truth instead must fit better than that.
_LOOKS_AWAY, _LOOKS_AT = 45.0, 20.0
# Two lines of sight nearly meet by chance.
_FEWEST = 3
_TO_OPENGL = np.diag([1.0, -1.0, -1.0])


def check_direction(path: Path, contents: Contents) -> None:
    """Refuse poses by which cameras look apart, where one other meaning lets all of them look at one point."""
    if len(contents.entries) < _FEWEST:
        return
    R = np.stack([entry.R for entry in contents.entries])
    t = np.stack([entry.t for entry in contents.entries])
    # What is no rotation is refused later.
    if np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max() > 1e-3 or _farthest(R, t) <= _LOOKS_AWAY:
        return
    fitting = [meaning for meaning, *pose in _others(R, t) if _farthest(*pose) < _LOOKS_AT]
    if fitting:
        raise fault(
            path, None,
            f"its cameras look apart, read as {contents.format}; they would all look at one point if {fitting[0]}: "
            "write x_cam = R x + t",
        )  # fmt: skip


def _others(R: np.ndarray, t: np.ndarray) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Other meanings of the numbers of a file, as poses from world to camera in OpenCV's axes."""
    back = R.transpose(0, 2, 1)
    yield "its translations were the optical centres", R, -_turned(R, t)
    yield "its optical centres were translations", R, -_turned(back, t)
    yield "its poses were from camera to world", back, -_turned(back, t)
    yield "its cameras looked along -z, as OpenGL's do", _TO_OPENGL @ R, t @ _TO_OPENGL
    yield "its poses were from camera to world in OpenGL's axes", _TO_OPENGL @ back, -_turned(back, t) @ _TO_OPENGL


def _turned(R: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.einsum("cij,cj->ci", R, x)


def _farthest(R: np.ndarray, t: np.ndarray) -> float:
    """The largest angle (degrees) between an axis and the point that is nearest to all of them."""
    centres, axes = -_turned(R.transpose(0, 2, 1), t), R[:, 2]
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    point = np.linalg.lstsq(across.sum(0), _turned(across, centres).sum(0), rcond=1e-9)[0]
    ahead = point - centres
    away = np.linalg.norm(ahead, axis=1)
    if not away.all():
        return 180.0
    return float(np.degrees(np.arccos(np.clip((ahead * axes).sum(1) / away, -1, 1))).max())
