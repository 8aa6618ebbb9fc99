"""Writes poses as, and reads marker trajectories from, TRC (Track Row Column), the text format of OpenSim and Pose2Sim.

Five lines of header and labels, then one row for each frame, with cells separated by tabs. The format is Motion
Analysis Corporation's; the writer satisfies OpenSim's reader, which is the strictest.
"""

import math
from pathlib import Path

import numpy as np

from ..._runtime.atomic_files import written_whole
from ..._runtime.plain_text import plain
from ...body import KeypointSet
from ...poses import Poses
from ..files import read_bounded
from ._markers import Markers, to_markers, with_up

_KEYS = (
    "DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units", "OrigDataRate", "OrigDataStartFrame",
    "OrigNumFrames",
)  # fmt: skip
_METRES = {"m": 1.0, "meters": 1.0, "metres": 1.0, "cm": 0.01, "mm": 0.001, "millimeters": 0.001, "millimetres": 0.001}
# Largest file (bytes) and coordinate (m), beyond any recording: others are refused before parsing.
_MOST_BYTES, _FARTHEST = 2_000_000_000, 1e6
# Largest number of positions: rows may be cut short, so few bytes can claim many markers in many frames. An hour of 50
# markers at 100 frames per second has fewer.
_MOST_POSITIONS = 20_000_000


def write_trc(
    path: str | Path,
    poses: Poses,
    *,
    up: str = "+Y",
    millimetres: bool = False,
    keypoint_set: KeypointSet | None = None,
) -> Path:
    """Write joints and tips, or keypoints, as markers, for OpenSim or Pose2Sim.

    A frame without a pose has empty cells, which OpenSim reads as missing. Times start at the first frame; frame
    numbers are those of `poses.frame_index`. Positions are rounded to a micrometre.

    Args:
        path: The file; its folder is created if missing.
        poses: Frames at `poses.fps`.
        up: World axis that points up in the file, which cannot state it. OpenSim expects +Y.
        millimetres: Whether to write millimetres instead of metres. The file states which.
        keypoint_set: What to write instead of joints and tips, such as `jaxskel.body.BODY_25`; keypoints that the
            skeleton has no point for are left out.

    Returns:
        The path.

    Raises:
        ValueError: There are no frames, the poses have no keypoints, or `up` is not one of
            `jaxskel.recording.UP_AXES`.
    """
    return _write(Path(path), to_markers(with_up(poses, up), keypoint_set), millimetres)


def write_trc_deviations(path: str | Path, poses: Poses, *, up: str = "+Y", millimetres: bool = False) -> Path:
    """Write the standard deviations of the joints' coordinates in the place of positions: a side file of `write_trc`.

    Whatever reads marker trajectories reads it. Axes, units and frames are those of `write_trc`; tips have none.

    Raises:
        ValueError: As `write_trc`, or the poses have no covariances.
    """
    turned = with_up(poses, up)
    if turned.covariance is None:
        raise ValueError("the poses have no covariances; run again, with settings that have a search")
    markers = to_markers(turned)
    deviations = np.sqrt(np.diagonal(turned.covariance, axis1=-2, axis2=-1)).astype(np.float64)
    return _write(
        Path(path),
        Markers(poses.template.joint_names, deviations, markers.fps, markers.up, markers.frame_index),
        millimetres,
    )


def _write(path: Path, markers: Markers, millimetres: bool) -> Path:
    positions = markers.positions * (1000.0 if millimetres else 1.0)
    decimals = 3 if millimetres else 6
    rate, frames = repr(float(markers.fps)), str(len(markers))
    values = (rate, rate, frames, str(len(markers.names)), "mm" if millimetres else "m", rate,
              str(markers.frame_index[0]), frames)  # fmt: skip
    lines = [
        # A line break or tab in the name would corrupt the header.
        f"PathFileType\t4\t(X/Y/Z)\t{plain(' '.join(path.name.split()))}",
        "\t".join(_KEYS),
        "\t".join(values),
        "Frame#\tTime\t" + "".join(f"{name}\t\t\t" for name in markers.names),
        "\t\t" + "".join(f"{axis}{i}\t" for i in range(1, len(markers.names) + 1) for axis in "XYZ"),
        "",
    ]
    for i, points in enumerate(positions):
        cells = ["" if math.isnan(x) else f"{x:.{decimals}f}" for x in points.ravel()]
        # OpenSim drops an empty cell at the end of a line, and then misses it, unless a tab follows.
        lines.append("\t".join([str(markers.frame_index[i]), f"{i / markers.fps:.9f}", *cells, ""]))
    with written_whole(path) as file:
        file.write("\n".join([*lines, ""]).encode())
    return path


def read_trc(path: str | Path, *, up: str = "+Y") -> Markers:
    """Read marker trajectories.

    The number of frames in the header is ignored: programs that cut a recording do not update it.

    Args:
        path: The file, in metres, centimetres or millimetres as its `Units` state.
        up: World axis that points up in the file, which does not state it. OpenSim expects +Y.

    Returns:
        The markers in metres; NaN if any of the three cells of a marker is empty or NaN.

    Raises:
        ValueError: One line that names the file and the line.
    """
    path = Path(path)
    text = read_bounded(path, _MOST_BYTES, "a recording").decode("latin-1")
    return parse_trc(text, up=up, name=str(path))


def parse_trc(text: str, *, up: str = "+Y", name: str = "TRC") -> Markers:
    """Read marker trajectories from the text of a file; the name is for error messages. See `read_trc`.

    Raises:
        ValueError: One line that names the file, the line and how to mend it.
    """
    name = " ".join(name.split())
    # Not splitlines, which also breaks lines at characters that may occur in a name.
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if lines[0].split()[:1] != ["PathFileType"]:
        raise ValueError(f"{name}:1: the line should begin with PathFileType; this is not a TRC file")
    if len(lines) < 6:
        raise ValueError(f"{name}:{len(lines)}: the file ends within its header")
    keys, values = lines[1].split(), lines[2].split()
    if len(keys) != len(values):
        raise ValueError(f"{name}:3: {len(values)} values for the {len(keys)} names of line 2")
    header = dict(zip(keys, values, strict=True))
    for key in ("DataRate", "NumMarkers", "Units"):
        if key not in header:
            raise ValueError(f"{name}:2: {key} is missing")
    fps = _number(header["DataRate"], f"{name}:3: DataRate")
    if not 0 < fps < 1e6:
        raise ValueError(f"{name}:3: DataRate is {fps:g}; give frames per second")
    scale = _METRES.get(header["Units"].lower())
    if scale is None:
        raise ValueError(f"{name}:3: Units {header['Units'][:20]!r}; give one of m, cm, mm")
    names = tuple(cell.strip() for cell in lines[3].split("\t")[2:] if cell.strip())
    if str(len(names)) != header["NumMarkers"]:
        raise ValueError(
            f"{name}:4: {len(names)} names, but NumMarkers is {header['NumMarkers'][:20]}; cells are parted by tabs"
        )
    if not names or len(set(names)) != len(names):
        raise ValueError(f"{name}:4: there is no marker, or two of the same name")
    if len(names) * (len(lines) - 5) > _MOST_POSITIONS:
        raise ValueError(f"{name}:4: {len(names)} markers in {len(lines) - 5} lines are too many; cut it into parts")
    rows = [
        _row(cells, len(names), f"{name}:{number}")
        for number, cells in enumerate((line.split("\t") for line in lines[5:]), 6)
        if any(cell.strip() for cell in cells)
    ]
    if not rows:
        raise ValueError(f"{name}:{len(lines)}: there is no frame")
    positions = np.array([row for _, row in rows]).reshape(len(rows), len(names), 3) * scale
    positions[np.isnan(positions).any(-1)] = np.nan
    if (np.abs(positions) > _FARTHEST).any():
        raise ValueError(f"{name}: a marker is {np.nanmax(np.abs(positions)):.0e} m away; are Units right?")
    return Markers(names, positions, fps, up, np.array([frame for frame, _ in rows]))


def _row(cells: list[str], markers: int, where: str) -> tuple[int, list[float]]:
    """Number and coordinates of a frame. Missing cells at the end are empty ones that the writer omitted."""
    frame, wanted = cells[0].strip(), 2 + 3 * markers
    if not (frame.removeprefix("-").isdigit() and frame.isascii() and len(frame) < 18):
        raise ValueError(f"{where}: {frame[:20]!r} should be the number of a frame")
    if len(cells) < 2:
        raise ValueError(f"{where}: frame {frame} has no time")
    _number(cells[1], f"{where}: time")
    found = cells[2:wanted]
    if len(cells) > wanted and any(cell.strip() for cell in cells[wanted:]):
        raise ValueError(f"{where}: {len(cells)} cells, where {wanted} belong to {markers} markers")
    if len(cells) < wanted and any(cell.strip() for cell in found):
        raise ValueError(f"{where}: {len(cells)} cells, where {wanted} belong to {markers} markers; is it cut short?")
    empty = ("", "nan")
    row = [math.nan if cell.strip().lower() in empty else _number(cell, where) for cell in found]
    return int(frame), row + [math.nan] * (3 * markers - len(row))


def _number(word: str, where: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{where}: {' '.join(word.split())[:40]!r} should be a number")
    return value
