"""Reads TOML written by hand: every fault is one line that names the file, the key and how to mend it."""

import difflib
import json
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ._bounded import read_bounded
from ._errors import fault

MOST_BYTES = 100_000
# The TOML parser takes time quadratic in the parts of a key (a.b.c): minutes for a file made of nothing else. No line
# written by hand is longer (characters), or has more keys and numbers with a dot.
_LONGEST_LINE, _MOST_DOTS = 4000, 100


def read_toml(path: Path, known: Iterable[str], wanted: str, example: str) -> dict[str, Any]:
    """Read a TOML file and check its top-level keys.

    Args:
        path: The file.
        known: Allowed keys.
        wanted: What the file should hold, for messages.
        example: A valid line of such a file, for messages.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    content = read_bounded(path, MOST_BYTES, f"a TOML file with {wanted}")
    try:
        text = content.decode("utf-8-sig")  # some editors of Windows begin with a mark
    except UnicodeDecodeError as error:
        raise fault(path, None, f"is not TOML ({error}); write for example: {example}") from None
    table = parse_toml(path, text, f"write for example: {example}")
    for key in table:
        check_known(path, key, known)
    return table


def parse_toml(path: Path, text: str, remedy: str) -> dict[str, Any]:
    """Parse the text of a file; a fault names the file and ends with the remedy.

    Raises:
        ValueError: The text is not TOML.
    """
    for line in text.splitlines():
        if len(line) > _LONGEST_LINE or line.count(".") > _MOST_DOTS:
            raise fault(path, None, f"is not TOML (a line is too long: {line[:60]!r}); {remedy}")
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise fault(path, None, f"is not TOML ({error}); {remedy}") from None


def check_known(path: Path, key: str, known: Iterable[str], where: str = "") -> None:
    """Refuse an unknown key, which is most likely a typing error.

    Raises:
        ValueError: The key is unknown; the line proposes the nearest known one.
    """
    known = list(known)
    if key not in known:
        nearest = difflib.get_close_matches(key, known, n=1, cutoff=0.0)[0]
        raise fault(path, f"{where}{key}", f"is not known; did you mean {nearest}?")


def quoted(text: str) -> str:
    """A text as a TOML string, whatever characters it has."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
