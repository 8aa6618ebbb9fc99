"""Finds sequence files by their keys."""

from pathlib import Path

from ..files import keys_of
from ._sequence_file import SILHOUETTES_OF


def holds_silhouettes(path: Path) -> bool:
    """Whether an `.npz` file is a sequence file, of one person or several, or too damaged to tell."""
    try:
        return any(key == "silhouettes" or key.startswith(SILHOUETTES_OF) for key in keys_of(path))
    except ValueError:
        return True


def sequence_files(folder: Path) -> list[Path]:
    """The sequence files in a folder, sorted by name."""
    return [path for path in sorted(folder.glob("*.npz")) if holds_silhouettes(path)]
