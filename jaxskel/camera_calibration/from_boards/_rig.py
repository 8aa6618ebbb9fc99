"""Calibrates the extrinsics of a rig from a board at one fixed place that all cameras see."""

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

# A board that fits worse is not flat, or was filmed with another lens than the intrinsics: this is many times the error
# of its corners (px in an image of 1000 px, scaled with the size).
_WORST_FIT = 1.0


@dataclass(frozen=True)
class BoardCalibration:
    """A rig calibrated with a board, and how well the board fits.

    Attributes:
        cameras: In the frame of the board (m): origin at its centre, x along its rows, z out of its face, towards the
            cameras. For a board on the floor, z points up.
        rms: Root mean square distance between the corners and their projections (px).
        spread: Root mean square distance of the corners from their mean over the film (px).
        turned: Cameras that saw a symmetric board from its other end, as the silhouettes showed or the caller stated.
        coverage: Share of the silhouettes that the hull covers, if they decided the ends of the board.
    """

    cameras: Cameras
    rms: Float[np.ndarray, " cams"]
    spread: Float[np.ndarray, " cams"]
    turned: tuple[str, ...]
    coverage: float | None


def calibrate_cameras(
    films: Mapping[str, str | Path],
    board: Board,
    intrinsics: Mapping[str, Intrinsics],
    silhouettes: UInt8[np.ndarray, "frames cams h w8"] | None = None,
    turned_cameras: Sequence[str] | None = None,
) -> BoardCalibration:
    """Calibrate the camera poses from films of one board at one place.

    A symmetric board, whose numbers of corners are both even or both odd, does not show which of its ends is the first.
    Silhouettes of a person in these views decide it, or the caller has to state it.

    Args:
        films: A video or a picture for each camera name.
        board: The board.
        intrinsics: Intrinsics of each camera, by name.
        silhouettes: Packed bits of a few frames, the cameras in the order of `films`.
        turned_cameras: Cameras that see a symmetric board from the other end than the first camera does, if known;
            empty if all see it from the same end.

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
    """Which cameras must be turned by half a turn, and the coverage of the silhouettes."""
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
