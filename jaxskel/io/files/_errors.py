"""The error for a file that is refused."""

from pathlib import Path

_MESSAGE = 1000  # characters of a message part, so that the line stays readable


def fault(path: Path, key: str | None, message: str) -> ValueError:
    """The `ValueError` for a fault of a file: one line, whatever line breaks its names and texts hold."""
    place = f"{path}: " if key is None else f"{path}: key {_cut(key)!r}: "
    return ValueError(" ".join((place + _cut(message)).split()))


def _cut(text: str) -> str:
    """A text with its middle left out if it is too long to read: names in files have any length."""
    return text if len(text) <= _MESSAGE else f"{text[: _MESSAGE // 2]} ... {text[-_MESSAGE // 2 :]}"
