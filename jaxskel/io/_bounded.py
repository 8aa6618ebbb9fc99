"""Files that may be anything, of any size."""

from pathlib import Path

from ._archive import fault

# A square of 8192 px: twice what the largest video cameras have.
MOST_PIXELS = 2**26


def check_pixels(path: Path, width: int, height: int, key: str | None = None) -> None:
    """Refuse images (px) that would fill the memory.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    if width * height > MOST_PIXELS:
        raise fault(
            path, key, f"claims images of {width} x {height} px, more than {MOST_PIXELS} pixels; reduce them, or if it "
            "is damaged, write it again",
        )  # fmt: skip


def read_bounded(path: Path, most: int, wanted: str) -> bytes:
    """The content of a file, which is never longer than `most` bytes.

    Args:
        path: The file.
        most: The greatest length (bytes); no more is read.
        wanted: What the file should be, for messages.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    try:
        with open(path, "rb") as file:
            content = file.read(most + 1)
    except OSError as error:
        raise fault(path, None, f"cannot be opened ({error.strerror}); check the path") from None
    except ValueError:  # a path with a zero in it
        raise fault(path, None, "is not a path; check it") from None
    if len(content) > most:
        size = f"{most / 1e6:g} MB" if most >= 1e5 else f"{most} bytes"
        raise fault(path, None, f"is longer than {size}, too long for {wanted}; check the path")
    return content
