"""TOML that a person wrote by hand: every fault is a line that names file and key and how to mend it."""

import difflib
import json
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ._bounded import read_bounded
from ._errors import fault

MOST_BYTES = 100_000
# The reader of TOML takes time by the square of the parts of a key, a.b.c: minutes, for a file that is nothing else.
# Nobody's lines are longer, or hold more keys and numbers with a dot.
_LONGEST_LINE, _MOST_DOTS = 4000, 100


def read_toml(path: Path, known: Iterable[str], wanted: str, example: str) -> dict[str, Any]:
    """What a file says, its topmost keys checked.

    Args:
        path: The file.
        known: The keys that it may have.
        wanted: What the file is, for messages.
        example: A line that such a file may hold, for messages.
    """
    content = read_bounded(path, MOST_BYTES, f"a TOML file with {wanted}")
    try:
        text = content.decode()
    except UnicodeDecodeError as error:
        raise fault(path, None, f"is not TOML ({error}); write for example: {example}") from None
    table = parse_toml(path, text, f"write for example: {example}")
    for key in table:
        check_known(path, key, known)
    return table


def parse_toml(path: Path, text: str, remedy: str) -> dict[str, Any]:
    """What a text says, or the fault of the file that it is of, which ends with the remedy."""
    for line in text.splitlines():
        if len(line) > _LONGEST_LINE or line.count(".") > _MOST_DOTS:
            raise fault(path, None, f"is not TOML (a line is too long: {line[:60]!r}); {remedy}")
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise fault(path, None, f"is not TOML ({error}); {remedy}") from None


def check_known(path: Path, key: str, known: Iterable[str], where: str = "") -> None:
    """Refuse a key that nobody reads: it is a slip of the pen."""
    known = list(known)
    if key not in known:
        nearest = difflib.get_close_matches(key, known, n=1, cutoff=0.0)[0]
        raise fault(path, f"{where}{key}", f"is not known; did you mean {nearest}?")


def quoted(text: str) -> str:
    """A text as TOML writes it, whatever is in it."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
