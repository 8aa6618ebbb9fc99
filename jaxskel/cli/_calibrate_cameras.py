"""`jaxskel calibrate-cameras`: calibrates camera poses from films of a checkerboard that all cameras see."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from ..camera_calibration.from_boards import Board, BoardCalibration, Intrinsics, board_intrinsics, some_frames
from ..camera_calibration.from_boards import calibrate_cameras as found_cameras
from ..cameras import FISHEYE_COEFFICIENTS
from ..io.calibrations import read_calibration, write_pose2sim_calibration
from ..recording import pack_silhouettes
from ._outputs import chosen_file
from ._ranges import check_number
from ._say import cell, say

_MOST_CORNERS = 500  # of a board, along either side: no camera resolves more
_MASKS = 3  # number of frames of a mask video that are used


def calibrate_cameras(
    films: Annotated[list[str], typer.Argument(metavar="CAM=FILE...", help="Film of the board, by camera.")],
    board: Annotated[str, typer.Option(help="Inner corners, such as 9x6: one less than squares in each direction.")],
    square: Annotated[float, typer.Option(help="Edge of a square (m).")],
    intrinsics: Annotated[
        list[str],
        typer.Option(
            metavar="FILE|CAM=FILE",
            help="Calibration file with the lenses of all cameras, or a video of the board moved about, by camera.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Pose2Sim TOML file to write.", show_default="calibration.toml"),
    ] = None,
    mask: Annotated[
        list[str] | None,
        typer.Option(metavar="CAM=FILE", help="Masks of a person, if the board looks the same after half a turn."),
    ] = None,
    other_end: Annotated[
        list[str] | None, typer.Option(metavar="CAM", help="A camera that sees such a board from its other end.")
    ] = None,
) -> None:
    """Find extrinsics from a checkerboard at rest in one place; the world's z points out of its face."""
    check_number("--square", square, 1e-3, 10, "the edge of a square in metres")
    sizes = board.lower().split("x")
    if len(sizes) != 2 or not all(part.isdecimal() for part in sizes):
        raise ValueError(f"--board {board}: give inner corners along and across, such as 9x6")
    for size in sizes:
        check_number("--board", int(size), 2, _MOST_CORNERS, "inner corners along and across")
    checkers = Board(int(sizes[0]), int(sizes[1]), square)
    by_camera = _by_camera("films", films)
    masks = _by_camera("--mask", mask) if mask else {}
    given = [Path(film if sign else name) for name, sign, film in (each.partition("=") for each in intrinsics)]
    output = chosen_file(output, "calibration.toml", [*by_camera.values(), *masks.values(), *given], (".toml",))
    lenses = _lenses(intrinsics, checkers)
    silhouettes = _silhouettes(masks, tuple(by_camera)) if masks else None
    found = found_cameras(by_camera, checkers, lenses, silhouettes, other_end)
    write_pose2sim_calibration(output, found.cameras)
    Console().print(_table(found))
    turned = f"; turned by 180 degrees: {', '.join(found.turned)}" if found.turned else ""
    covered = "" if found.coverage is None else f"; the hull covers {100 * found.coverage:.0f} % of the silhouettes"
    say(f"{output}: {len(found.cameras)} cameras, corners fit to {found.rms.max():.2f} px or better{turned}{covered}")


def _lenses(given: list[str], board: Board) -> dict[str, Intrinsics]:
    lenses = {}
    for each in given:
        name, is_film, film = each.partition("=")
        if is_film:
            lenses[name] = board_intrinsics(film, board)
        else:
            cameras = read_calibration(each).cameras
            for i, camera in enumerate(cameras.names):
                size = (int(cameras.size[i, 0]), int(cameras.size[i, 1]))
                fisheye = bool(cameras.are_fisheye[i])
                dist = np.asarray(cameras.dist[i])[: FISHEYE_COEFFICIENTS if fisheye else None]
                lenses[camera] = Intrinsics(np.asarray(cameras.K[i]), dist, size, fisheye=fisheye)
    return lenses


def _silhouettes(masks: dict[str, Path], cameras: tuple[str, ...]) -> np.ndarray:
    if set(masks) != set(cameras):
        raise ValueError(f"--mask: give one for each of {', '.join(cameras)}, not for {', '.join(masks)}")
    films = [[image.max(2) > 127 for image in some_frames(masks[name], _MASKS)] for name in cameras]
    if len({len(film) for film in films}) > 1:
        raise ValueError("--mask: the videos are not equally long; give synchronised ones")
    height, width = np.max([film[0].shape for film in films], axis=0)
    stack = np.zeros((len(films[0]), len(films), height, width), bool)
    for c, film in enumerate(films):
        for f, image in enumerate(film):
            stack[f, c, : image.shape[0], : image.shape[1]] = image
    return pack_silhouettes(stack)


def _by_camera(what: str, given: list[str]) -> dict[str, Path]:
    pairs = [each.partition("=") for each in given]
    names = [name for name, _, _ in pairs]
    if not all(name and sign and path for name, sign, path in pairs) or len(set(names)) < len(names):
        raise ValueError(f"{what}: give CAM=FILE once for each camera, such as left=left.avi, not {' '.join(given)}")
    return {name: Path(path) for name, _, path in pairs}


def _table(found: BoardCalibration) -> Table:
    table = Table(title="cameras in the frame of the board")
    for column in ("camera", "fit px", "spread px", "x m", "y m", "z m"):
        table.add_column(column, justify="left" if column == "camera" else "right")
    for name, rms, spread, centre in zip(
        found.cameras.names, found.rms, found.spread, found.cameras.centres, strict=True
    ):
        table.add_row(cell(name), f"{rms:.2f}", f"{spread:.2f}", *(f"{metres:.3f}" for metres in centre))
    return table
