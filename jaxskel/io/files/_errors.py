"""The one line by which a file is refused."""

from pathlib import Path

_MESSAGE = 1000  # characters


def fault(path: Path, key: str | None, message: str) -> ValueError:
    """The one line for a fault of a file, whatever line breaks its names and texts hold."""
    place = f"{path}: " if key is None else f"{path}: key {_cut(key)!r}: "
    return ValueError(" ".join((place + _cut(message)).split()))


def _cut(text: str) -> str:
    """A text whose middle is left out where it is too long to be read: names in files have any length."""
    return text if len(text) <= _MESSAGE else f"{text[: _MESSAGE // 2]} ... {text[-_MESSAGE // 2 :]}"
