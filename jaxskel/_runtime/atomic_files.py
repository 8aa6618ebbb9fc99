"""Atomic writing of files: a file appears complete or not at all."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

# Processes that start together may remove a folder that another is about to use, so the check is repeated.
_TRIALS = 4


@contextmanager
def written_whole(path: Path, mode: int = 0o666) -> Iterator[IO[bytes]]:
    """Open a file for writing that appears under its name only once it is complete.

    Args:
        path: The file; its folder is made if it is missing.
        mode: Permissions of the file, before the user's umask.

    Raises:
        ValueError: Something other than a file has this name.
        OSError: It cannot be written.
    """
    check_replaceable(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = _unfinished(path)
    try:
        with open(unfinished, "wb", opener=lambda name, flags: os.open(name, flags, mode)) as file:
            yield file
        os.replace(unfinished, path)
    except OSError as error:
        # The error of a full disk does not name the file.
        raise error if error.filename else OSError(error.errno, f"cannot be written ({error})", str(path)) from error
    finally:
        unfinished.unlink(missing_ok=True)


def check_replaceable(path: Path) -> None:
    """Refuse a name that belongs to a folder, a device or a FIFO, which a file must not replace.

    Raises:
        ValueError: The name is refused; a one-line message that contains it.
    """
    try:
        mode = os.stat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as error:
        raise ValueError(f"{path}: cannot be written ({error.strerror}); choose another name") from None
    except ValueError:
        raise ValueError(f"{path!r}: is not a path; choose another name") from None
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "no regular file"
        raise ValueError(f"{path}: the output must be a file, but this is {kind}; choose another name")


def check_writable(path: Path) -> None:
    """Check that a file can be written: make its folder and a hidden file in it, and remove both.

    Raises:
        ValueError: It cannot; a one-line message with the file, or with the folder that prevents it.
    """
    check_replaceable(path)
    for _ in range(_TRIALS - 1):
        with suppress(FileNotFoundError):
            return _try_writing(path)
    try:
        _try_writing(path)
    except FileNotFoundError as error:
        raise ValueError(f"{path}: cannot be written ({error.strerror}); choose another output") from None


def _try_writing(path: Path) -> None:
    made: list[Path] = []
    place = path.parent
    try:
        for place in reversed((path.parent, *path.parent.parents)):
            if not place.is_dir():
                with _unless_another_made_it(place):
                    place.mkdir()
                    made.append(place)
        place = path
        trial = _unfinished(path)
        try:
            trial.touch()
            with suppress(FileNotFoundError):
                os.lstat(path)  # raises if the name is too long, although that of the trial is not
        finally:
            trial.unlink(missing_ok=True)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise ValueError(f"{place}: cannot be written ({error.strerror}); choose another output") from None
    finally:
        for folder in reversed(made):
            with suppress(OSError):
                folder.rmdir()


@contextmanager
def _unless_another_made_it(folder: Path) -> Iterator[None]:
    try:
        yield
    except FileExistsError:
        if not folder.is_dir():
            raise


def _unfinished(path: Path) -> Path:
    """Temporary name of a file until it is complete, shortened because names have a maximum length."""
    return path.with_name(f".{path.name[:40]}.{os.getpid()}.part")
