"""Outcomes of reading a file."""

from pathlib import Path

from support.readers import READERS


def outcome(path: Path, reader: str, folder: Path) -> str | None:
    """A reader's error message about some files; None if they are valid."""
    try:
        found = READERS[reader].read(path)
        READERS[reader].check(found)
    except ValueError as error:
        refusal = error
    else:
        return None
    assert type(refusal) is ValueError, repr(refusal)
    told = str(refusal)
    assert len(told.splitlines()) == 1, told
    assert len(told) < 5000, told
    assert told.startswith(str(folder)), told
    return told
