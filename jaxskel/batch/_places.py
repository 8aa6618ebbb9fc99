"""Checks, before any work is done, that the results of a batch can be written."""

import os
import tempfile
import unicodedata
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from ..io.files import fault
from ._folders import ResultFolder
from ._overlaps import check_overlaps
from ._sources import Source

# Size of the test file (bytes): a disk without room for it has no room for a result either.
_TRIED = 1 << 16


def check_places(sources: Sequence[Source], output: Path, subject: Path | None = None) -> None:
    """Refuse a batch whose results would overlap with inputs or with other people's files, or cannot be written.

    The folder of the results is created; nothing else remains of this check.

    Args:
        sources: All recordings of the batch.
        output: Folder of the results.
        subject: The subject's file, if one is given for all.

    Raises:
        ValueError: One line that names what is in the way and how to mend it.
    """
    check_overlaps(sources, output, subject)
    for source in sources:
        folder = ResultFolder(output, source.name)
        folder.check()
        for place in folder.written:
            if place.exists() and not os.access(place, os.W_OK | os.X_OK):
                raise fault(place, None, "cannot be written to (no permission); choose another output")
    if not _tells_cases_apart(output):
        _check_cases(sources)


def _tells_cases_apart(output: Path) -> bool:
    """Write test files into a folder; return whether names that differ only in case are different files there."""
    made: list[Path] = []
    try:
        for folder in reversed((output, *output.parents)):
            if not folder.is_dir():
                folder.mkdir(exist_ok=True)
                made.append(folder)
        with tempfile.NamedTemporaryFile(dir=output, prefix=".try") as file:
            file.write(bytes(_TRIED))
            file.flush()
            os.fsync(file.fileno())
            return not os.path.exists(os.path.join(output, os.path.basename(file.name).swapcase()))
    except OSError as error:
        for folder in reversed(made):
            with suppress(OSError):
                folder.rmdir()
        raise fault(output, None, f"cannot be written to ({error.strerror}); choose another output") from None


def _check_cases(sources: Sequence[Source]) -> None:
    found: dict[str, Source] = {}
    for source in sources:
        same = found.setdefault(unicodedata.normalize("NFC", source.name).casefold(), source)
        if same is not source:
            raise fault(
                source.path, None, f"its result, {source.name}, would be in the same place as {same.name}: this disk "
                "does not distinguish capitals from small letters; rename one of them",
            )  # fmt: skip
