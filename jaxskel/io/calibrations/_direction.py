"""Checks whether the cameras look at one point from several sides, or would with another meaning of their poses.

Whether a rotation and three numbers mean x_cam = R x + t, or the camera's centre, or the inverse pose, only follows
from the convention of a format. Cameras that film a person look at it from several sides. If they do not, but all of
them would with another meaning of the numbers, the file is refused.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..files import fault
from ._calibration import Contents

# Angles between a camera's axis and the common point (degrees): above the first, a camera looks away; below the second,
# it looks at it. A person may fill the image of a wide lens, up to 35 degrees from its centre.
_LOOKS_AWAY, _LOOKS_AT = 45.0, 20.0
# Angle between the two farthest cameras, seen from that point (degrees), that another meaning must exceed, and the
# factor by which it must enlarge it unless a camera looks away: misread cameras cluster. With these limits, none of
# 3600 random rigs (three to sixteen cameras, in a row or in a ring) was refused.
_SEVERAL_SIDES, _FACTOR = 60.0, 2.0
# Smallest number of cameras: two optical axes nearly meet by chance.
_FEWEST = 3
_TO_OPENGL = np.diag([1.0, -1.0, -1.0])


def check_direction(path: Path, contents: Contents) -> None:
    """Refuse poses with which cameras look apart, if another meaning lets all of them look at one point."""
    if len(contents.entries) < _FEWEST:
        return
    R = np.stack([entry.R for entry in contents.entries])
    t = np.stack([entry.t for entry in contents.entries])
    # A matrix that is no rotation is refused later.
    if np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max() > 1e-3:
        return
    away, apart = _looks(R, t)
    better = []
    for meaning, *pose in _others(R, t):
        farthest, sides = _looks(*pose)
        if farthest < _LOOKS_AT and sides > _SEVERAL_SIDES and (away > _LOOKS_AWAY or sides > _FACTOR * apart):
            better.append((farthest, meaning))
    if better:
        raise fault(
            path, None,
            f"its cameras look apart or stand on a heap, read as {contents.format}; all would look at one point if "
            f"{min(better)[1]}: write x_cam = R x + t, from world to camera",
        )  # fmt: skip


def _others(R: np.ndarray, t: np.ndarray) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Other meanings of the numbers of a file, as world-to-camera poses in OpenCV's axes."""
    back = R.transpose(0, 2, 1)
    yield "its translations were the optical centres", R, -_turned(R, t)
    yield "its optical centres were translations", R, -_turned(back, t)
    yield "its poses were from camera to world", back, -_turned(back, t)
    yield "its cameras looked along -z, as OpenGL's do", _TO_OPENGL @ R, t @ _TO_OPENGL
    yield "its poses were from camera to world in OpenGL's axes", _TO_OPENGL @ back, -_turned(back, t) @ _TO_OPENGL


def _turned(R: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.einsum("cij,cj->ci", R, x)


def _looks(R: np.ndarray, t: np.ndarray) -> tuple[float, float]:
    """For the point nearest to all axes: the largest angle (degrees) from an axis, and between two cameras."""
    centres, axes = -_turned(R.transpose(0, 2, 1), t), R[:, 2]
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    point = np.linalg.lstsq(across.sum(0), _turned(across, centres).sum(0), rcond=1e-9)[0]
    ahead = point - centres
    distances = np.linalg.norm(ahead, axis=1, keepdims=True)
    if not distances.all():
        return 180.0, 0.0
    rays = ahead / distances
    return _largest((rays * axes).sum(1)), _largest(rays @ rays.T)


def _largest(cosines: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0))).max())
