"""Files that are whole or not there."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

# Of several processes that start together each may remove a folder that another one is about to try: then once more.
_TRIALS = 4


@contextmanager
def written_whole(path: Path, mode: int = 0o666) -> Iterator[IO[bytes]]:
    """Open a file for writing that appears under its name only once it is complete.

    Args:
        path: The file; its folder is made where it is missing.
        mode: Who may read and write it, but for what the user's umask takes away.

    Raises:
        ValueError: There is something else than a file under this name.
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
        # A full disk does not say which file it is.
        raise error if error.filename else OSError(error.errno, f"cannot be written ({error})", str(path)) from error
    finally:
        unfinished.unlink(missing_ok=True)


def check_replaceable(path: Path) -> None:
    """Refuse a name under which there is a folder, a device or a FIFO: a file must not take its place.

    Raises:
        ValueError: One line that names it.
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
    """Try whether a file can be written: make its folder and a hidden file in it, and remove both.

    Raises:
        ValueError: One line that names the file, or the folder that is in the way or cannot be written.
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
                os.lstat(path)  # a name may be too long, though that of the trial is not
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
    """The name of a file until it is complete; a part of its own, because names have a greatest length."""
    return path.with_name(f".{path.name[:40]}.{os.getpid()}.part")
