"""Checks outputs before any work: that they can be written, and that they replace no file of the user.

A file that the user names is overwritten, as by any tool, unless the command reads it. Under a name that the command
chooses itself, only a file that jaxskel wrote is replaced.
"""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from .._runtime.atomic_files import check_replaceable, check_writable
from ..io.files import check_regular, is_ours
from ..io.recordings import RECORDING_FILE, input_paths
from ..io.views import is_image

# Suffixes of calibration files in a folder.
_CALIBRATIONS = (".yml", ".yaml", ".txt", ".json", ".xml")


def files_of(recording: Path) -> list[Path]:
    """The files, and folders of files, that a recording is read from.

    Raises:
        ValueError: Its `recording.toml` is no regular file.
    """
    folder = recording.parent if recording.name == RECORDING_FILE else recording
    if folder.is_dir():
        if (folder / RECORDING_FILE).exists():
            check_regular(folder / RECORDING_FILE)
        return list(input_paths(folder).values())
    return [recording]


def check_output(folder: Path, names: Sequence[str] = (), inputs: Iterable[Path] = ()) -> None:
    """Refuse an output folder that is no folder, is not writable, or holds files in the way.

    Args:
        folder: Folder to write to.
        names: Names of the files that the command writes there.
        inputs: Files that the command reads.

    Raises:
        ValueError: One line that names the file in the way, or what cannot be written.
    """
    if os.path.exists(folder) and not os.path.isdir(folder):
        raise ValueError(f"{folder}: the output must be a folder, but this is a file; choose another name")
    inputs = list(inputs)
    for name in names:
        _check_own_name(folder / name, inputs)
    check_writable(folder / (names[0] if names else "output"))


def check_output_file(path: Path, inputs: Iterable[Path] = (), suffixes: Sequence[str] = ()) -> None:
    """Refuse an output file named by the user that cannot be written, or that the command reads.

    Args:
        path: The file.
        inputs: Files that the command reads.
        suffixes: Allowed suffixes, if the suffix decides the format.

    Raises:
        ValueError: One line that names the file.
    """
    check_replaceable(path)
    if suffixes and path.suffix.lower() not in suffixes:
        known = " or ".join((", ".join(suffixes[:-1]), suffixes[-1])) if len(suffixes) > 1 else suffixes[0]
        raise ValueError(f"{path}: its name decides how it is written; give one that ends in {known}")
    _check_apart(path, inputs)
    check_writable(path)


def chosen_file(path: Path | None, default: str, inputs: Iterable[Path] = (), suffixes: Sequence[str] = ()) -> Path:
    """The file that the user names, or else the default one, checked in either case.

    Raises:
        ValueError: One line that names the file.
    """
    if path is not None:
        check_output_file(path, inputs, suffixes)
        return path
    _check_own_name(Path(default), list(inputs))
    check_writable(Path(default))
    return Path(default)


def _check_own_name(path: Path, inputs: list[Path]) -> None:
    check_replaceable(path)
    _check_apart(path, inputs)
    if os.path.lexists(path) and not is_ours(path):
        raise ValueError(f"{path}: exists already, and jaxskel did not write it; move it, or choose another output")


def _check_apart(output: Path, inputs: Iterable[Path]) -> None:
    for source in inputs:
        if _is_one_of(output, source):
            raise ValueError(f"{output}: is read by this command, so it cannot be its output; choose another name")


def _is_one_of(output: Path, source: Path) -> bool:
    """Whether a file is an input, or would become one in a folder of images or calibration files."""
    try:
        if source.is_dir():
            read = is_image(output) or output.suffix.lower() in _CALIBRATIONS
            return read and output.parent.is_dir() and os.path.samefile(output.parent, source)
        return output.exists() and os.path.samefile(output, source)
    except OSError:
        return False
