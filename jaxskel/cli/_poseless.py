"""How commands end that were given poses without a single one: done, but it is told."""

from pathlib import Path

import typer

from ..poses import Poses
from ._say import warn


def end_without_pose(path: Path, poses: Poses) -> None:
    """End with exit code 1 where no frame has a pose, and say so."""
    if not poses.has_pose.any():
        warn(f"{path}: no frame has a pose")
        raise typer.Exit(1)
