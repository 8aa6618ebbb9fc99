"""TOML that a person wrote by hand: every fault is a line that names file and key and how to mend it."""

import difflib
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ._archive import fault
from ._bounded import read_bounded

_MAX_BYTES = 100_000


def read_toml(path: Path, known: Iterable[str], wanted: str, example: str) -> dict[str, Any]:
    """What a file says, its topmost keys checked.

    Args:
        path: The file.
        known: The keys that it may have.
        wanted: What the file is, for messages.
        example: A line that such a file may hold, for messages.
    """
    content = read_bounded(path, _MAX_BYTES, f"a TOML file with {wanted}")
    try:
        table = tomllib.loads(content.decode())
    except (ValueError, RecursionError) as error:
        raise fault(path, None, f"is not TOML ({error}); write for example: {example}") from None
    for key in table:
        check_known(path, key, known)
    return table


def check_known(path: Path, key: str, known: Iterable[str], where: str = "") -> None:
    """Refuse a key that nobody reads: it is a slip of the pen."""
    known = list(known)
    if key not in known:
        nearest = difflib.get_close_matches(key, known, n=1, cutoff=0.0)[0]
        raise fault(path, f"{where}{key}", f"is not known; did you mean {nearest}?")
