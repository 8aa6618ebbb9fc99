"""Extrinsics of a rig from a board that lies or stands at one place that all cameras see."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from ...cameras import Cameras, make_cameras
from ._board import Board
from ._films import still_board
from ._intrinsics import Intrinsics
from ._pose import camera_pose
from ._turns import settle_turns, turned

# A board that fits worse than this is not flat, or was filmed through another lens than the intrinsics say: many
# times what its corners are off (px of an image of 1000 px, and in proportion).
_WORST_FIT = 1.0


@dataclass(frozen=True)
class BoardCalibration:
    """A rig calibrated by a board, and how well the board fits."""

    cameras: Cameras
    """In the frame of the board (m): origin at its centre, x along its rows, z out of its face, where the cameras are.
    Of a board on the floor, z is up."""
    rms: Float[np.ndarray, " cams"]
    """Root mean square distance of the corners from where the calibration puts them (px)."""
    spread: Float[np.ndarray, " cams"]
    """Of the corners over the frames of the film (px)."""
    turned: tuple[str, ...]
    """Cameras that saw a symmetric board from its other end, which was settled by the silhouettes or given."""
    coverage: float | None
    """Of the silhouettes by the hull, if they settled it."""


def calibrate_cameras(
    films: Mapping[str, str | Path],
    board: Board,
    intrinsics: Mapping[str, Intrinsics],
    silhouettes: UInt8[np.ndarray, "frames cams h w8"] | None = None,
    turned_cameras: Sequence[str] | None = None,
) -> BoardCalibration:
    """Find where the cameras are from films of one board at one place.

    A symmetric board, of two even or two odd numbers of corners, does not show which of its ends is the first. It is
    settled by silhouettes of a person in these views, or has to be given.

    Args:
        films: A video or a picture by the name of its camera.
        board: The board.
        intrinsics: Of each camera by name.
        silhouettes: Packed bits of a few frames, the cameras in the order of `films`.
        turned_cameras: Those cameras that see a symmetric board from its other end than the first camera does, if
            that is known; empty if all see it from the same.

    Raises:
        ValueError: One line that names camera and file, and how to mend it.
    """
    names = tuple(films)
    if len(names) < 2:
        raise ValueError(f"{len(names)} camera: give films of two cameras or more, of the same board")
    _check_names("intrinsics", intrinsics, names)
    _check_names("turned cameras", turned_cameras or (), names, all_of=False)
    seen, poses = [], []
    for name, film in films.items():
        lens = intrinsics[name]
        try:
            found = still_board(film, board)
        except ValueError as error:
            raise ValueError(f"camera {name}: {error}") from None
        if found.size != lens.size:
            raise ValueError(
                f"camera {name}: {film} is {found.size[0]} x {found.size[1]} px, but its intrinsics are those of "
                f"{lens.size[0]} x {lens.size[1]} px: film both in the same mode"
            )
        seen.append(found)
        try:
            poses.append(camera_pose(found.corners, board, lens.K, lens.dist, lens.fisheye))
        except ValueError as error:
            raise ValueError(f"camera {name}: {film}: {error}") from None
        if poses[-1][2] > _WORST_FIT * found.size[0] / 1000:
            raise ValueError(
                f"camera {name}: {film}: the board fits to {poses[-1][2]:.1f} px only; are the intrinsics those of "
                "this camera, zoom and mode, and is the board flat?"
            )
    lenses = [intrinsics[name] for name in names]
    dist = np.zeros((len(names), 8))
    for row, lens in zip(dist, lenses, strict=True):
        row[: len(lens.dist)] = lens.dist
    cameras = make_cameras(
        np.stack([lens.K for lens in lenses]), np.stack([pose[0] for pose in poses]),
        np.stack([pose[1] for pose in poses]), np.array([lens.size for lens in lenses]), dist, names,
        fisheye=[lens.fisheye for lens in lenses],
    )  # fmt: skip
    other_end, coverage = _other_end(cameras, board, silhouettes, turned_cameras)
    return BoardCalibration(
        cameras=turned(cameras, other_end),
        rms=np.array([pose[2] for pose in poses]),
        spread=np.array([found.spread for found in seen]),
        turned=tuple(name for name, other in zip(names, other_end, strict=True) if other),
        coverage=coverage,
    )


def _other_end(
    cameras: Cameras, board: Board, silhouettes: np.ndarray | None, given: Sequence[str] | None
) -> tuple[np.ndarray, float | None]:
    """Which cameras are to be turned, and the coverage of the silhouettes."""
    if not board.symmetric:
        return np.zeros(len(cameras), bool), None
    if given is not None:
        return np.array([name in given for name in cameras.names]), None
    mend = f"take a board of one even and one odd number of corners, such as {board.columns + 1} x {board.rows}"
    if silhouettes is None:
        raise ValueError(
            f"a board of {board.columns} x {board.rows} corners looks the same from both of its ends: give silhouettes "
            f"of a person in these views, tell which cameras see its other end, or {mend}"
        )
    if silhouettes.ndim != 4 or silhouettes.shape[1] != len(cameras):
        raise ValueError(f"silhouettes of shape {silhouettes.shape}: give those of the {len(cameras)} cameras' films")
    settled = settle_turns(cameras, silhouettes)
    if settled is None:
        raise ValueError(
            f"a board of {board.columns} x {board.rows} corners looks the same from both of its ends, and the "
            f"silhouettes do not tell: give some of a person beside the board's middle, seen by all cameras, or {mend}"
        )
    return settled


def _check_names(what: str, given: Mapping | Sequence[str], names: tuple[str, ...], all_of: bool = True) -> None:
    missing = [name for name in names if name not in given] if all_of else []
    unknown = [] if all_of else [name for name in given if name not in names]
    if missing or unknown:
        wrong = f"there are none of {', '.join(missing)}" if missing else f"there is no camera {', '.join(unknown)}"
        raise ValueError(f"{what}: {wrong}; the films are of {', '.join(names)}")
