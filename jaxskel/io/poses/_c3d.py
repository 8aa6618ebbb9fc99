"""Writes poses as C3D, the binary format of motion capture laboratories, with the package ezc3d."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from ..._runtime.atomic_files import written_whole
from ...body import KeypointSet
from ...poses import Poses
from ._markers import Markers, to_markers, with_up

# Largest frame number: frames are counted from 1 in 16 bits.
_MOST_FRAMES = 2**16 - 1


def write_c3d(path: str | Path, poses: Poses, *, up: str = "+Z", keypoint_set: KeypointSet | None = None) -> Path:
    """Write joints and tips, or keypoints, as points (mm).

    A frame without a pose has points with residual -1, which marks them as not seen. The format counts frames from 1,
    without gaps: frame 0 of the material is frame 1 of the file, and `poses.frame_index` only sets the first number
    (not even that, if the last one would exceed the format's limit of 65535).

    Args:
        path: The file; its folder is created if missing.
        poses: Frames at `poses.fps`.
        up: World axis that points up in the file. It is stated as POINT:Y_SCREEN, the axis that points up on a screen,
            and in the descriptions of the points.
        keypoint_set: What to write instead of joints and tips, as in `write_trc`.

    Returns:
        The path.

    Raises:
        ValueError: There are no frames or more than 65535, the poses have no keypoints, or `up` is not one of
            `jaxskel.recording.UP_AXES`.
        ImportError: ezc3d is not installed.
    """
    ezc3d = _ezc3d()
    path, markers = Path(path), to_markers(with_up(poses, up), keypoint_set)
    if len(markers) > _MOST_FRAMES:
        raise ValueError(f"{path}: {len(markers)} frames; a C3D holds {_MOST_FRAMES} at most, so cut them into parts")
    seen = ~np.isnan(markers.positions).any(-1)
    file: Any = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"] = [float(markers.fps)]
    point["UNITS"]["value"] = ["mm"]
    point["LABELS"]["value"] = list(markers.names)
    point["DESCRIPTIONS"]["value"] = [f"{name}, mm, {up} up" for name in markers.names]
    file.add_parameter("POINT", "X_SCREEN", [_across(up)])
    file.add_parameter("POINT", "Y_SCREEN", [up])
    start = int(markers.frame_index[0])
    # Counted from 0 here; ezc3d adds 1.
    file["header"]["points"]["first_frame"] = start if 0 <= start <= _MOST_FRAMES - len(markers) else 0
    file["data"]["points"] = _by_axis(markers)
    file["data"]["meta_points"]["residuals"] = np.where(seen, 0.0, -1.0).T[None]
    # ezc3d only writes to a name that ends in .c3d, so write to a temporary folder first and copy atomically.
    with tempfile.TemporaryDirectory() as folder, written_whole(path) as whole:
        unfinished = Path(folder) / "poses.c3d"
        file.write(str(unfinished))
        whole.write(unfinished.read_bytes())
    return path


def _by_axis(markers: Markers) -> np.ndarray:
    """Homogeneous points (mm), ``(4, markers, frames)``."""
    points = np.ones((4, *markers.positions.shape[1::-1]))
    points[:3] = 1000.0 * markers.positions.transpose(2, 1, 0)
    return points


def _across(up: str) -> str:
    """A horizontal axis that points to the right on a screen."""
    return "+Y" if up[1] == "X" else "+X"


def _ezc3d() -> Any:
    try:
        import ezc3d  # an optional dependency, which takes a tenth of a second to import
    except ImportError as error:
        raise ImportError('C3D files are written by ezc3d, which is missing: pip install "jaxskel[export]"') from error
    return ezc3d
