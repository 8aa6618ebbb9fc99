"""Ends commands that were given poses without a single one: done, but with a message."""

from pathlib import Path

import typer

from ..poses import Poses
from ._say import warn


def end_without_pose(path: Path, poses: Poses) -> None:
    """Print a message and end with exit code 1 if no frame has a pose."""
    if not poses.has_pose.any():
        warn(f"{path}: no frame has a pose")
        raise typer.Exit(1)
