"""Ends commands that were given poses without a single one: done, but with a message."""

from pathlib import Path

import typer

from ..poses import Poses
from ._say import warn


def end_without_pose(path: Path, *people: Poses) -> None:
    """Print a message and end with exit code 1 if no frame has a pose of anybody."""
    if not any(poses.has_pose.any() for poses in people):
        warn(f"{path}: no frame has a pose")
        raise typer.Exit(1)
