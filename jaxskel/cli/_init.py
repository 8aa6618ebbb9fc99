"""`jaxskel init`: writes a `recording.toml` for the content of a folder."""

from pathlib import Path
from typing import Annotated

import typer

from .._runtime.atomic_files import check_writable, written_whole
from ..cameras import ImageChange
from ..io.proposals import propose_recording
from ..io.recordings import RECORDING_FILE, read_change
from ._say import say


def init(
    folder: Annotated[Path, typer.Argument(help="Folder with a calibration and a view for each camera.")],
    views: Annotated[
        str | None,
        typer.Option(help="Which files or folders are the views, such as 'masks/*', if there are several."),
    ] = None,
    calibration: Annotated[str | None, typer.Option(help="The calibration file, if there are several.")] = None,
    fps: Annotated[float | None, typer.Option(help="Frames per second, if no video gives it.")] = None,
    turn: Annotated[
        int | None, typer.Option(help="For images not of the calibrated size: turn in degrees clockwise.")
    ] = None,
    crop: Annotated[
        str | None, typer.Option(help="For these: their first pixel in the calibrated image (px), as 0,27.")
    ] = None,
    scale: Annotated[
        str | None, typer.Option(help="For these: image pixels per calibrated pixel, as 0.5, or across,down.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing recording.toml.")] = False,
) -> None:
    """Write a commented recording.toml for a folder's files, so that `run`, `check` and others can read the folder."""
    path = folder / RECORDING_FILE
    if not folder.is_dir():
        raise ValueError(f"{folder}: give a folder with a calibration and a view for each camera")
    if path.exists() and not force:
        raise ValueError(f"{path}: exists already; edit it, or overwrite it with --force")
    if fps is not None and not 0 < fps < 1e6:
        raise ValueError(f"--fps {fps:g}: give a positive number of frames per second")
    check_writable(path)
    proposal = propose_recording(folder, views, calibration, fps, _change(turn, crop, scale))
    with written_whole(path) as file:
        file.write(proposal.text.encode())
    for doubt in proposal.doubts:
        say(f"check: {doubt}")
    say(f"{path}: {proposal.text.count('[views.')} views; next: jaxskel check {folder}")


def _change(turn: int | None, crop: str | None, scale: str | None) -> ImageChange | None:
    """The change of the images that the options state, checked like the keys of a recording.toml."""
    given = {"turn": turn, "crop": _numbers(crop), "scale": _numbers(scale)}
    table = {key: value for key, value in given.items() if value is not None}
    return read_change(Path("jaxskel init"), "--", table) if table else None


def _numbers(text: str | None) -> str | float | list[float] | None:
    """Numbers separated by commas; invalid text is returned unchanged, for the error message."""
    if text is None:
        return None
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        return text
    return found if len(found) > 1 else found[0]
