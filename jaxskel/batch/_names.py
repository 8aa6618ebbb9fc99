"""Valid names of results, and the names of their locks."""

import hashlib
import os
from pathlib import Path
from urllib.parse import quote

from ..io.files import fault

MANIFEST_FILE = "manifest.json"
POSES_FILES = ("poses.npz", "poses.csv")
RESULT_FILES = (*POSES_FILES, MANIFEST_FILE)
FAILED_SUFFIX = ".failed.json"
SUMMARY_FILE = "summary.csv"

# Of the 255 bytes that file systems allow, `.NAME.failed.json.PID.part` needs up to 29 besides NAME.
_LONGEST = 226
# A lock's name is shortened above this length (bytes), because the locking library temporarily adds a suffix.
_LONGEST_LOCK = 180


def check_name(path: Path, name: str) -> None:
    """Refuse a name that a result cannot have, or under which it would not be found again.

    Args:
        path: The recording, for messages.
        name: Name of its result, with ``/`` between folders.

    Raises:
        ValueError: One line that names the recording and how to mend it.
    """
    for part in name.split("/"):
        told = None
        if part in ("", ".", "..") or "\0" in part:
            told = "which is not a valid name"
        elif part.startswith("."):
            told = "which is hidden, like the batch's own files"
        elif part.lower() in (*RESULT_FILES, SUMMARY_FILE) or part.lower().endswith(FAILED_SUFFIX):
            told = "like a file that the batch writes itself"
        elif len(os.fsencode(part)) > _LONGEST:
            told = f"which is longer than {_LONGEST} bytes"
        if told is not None:
            raise fault(path, None, f"its result would be called {part!r}, {told}; rename it")


def lock_name(name: str) -> str:
    """The name of a result's lock: no two results share one, and none is too long for a file."""
    quoted = quote(os.fsencode(name), safe=" ")
    if len(quoted) > _LONGEST_LOCK:
        # A quoted name never holds two % in a row.
        quoted = f"{quoted[:40]}%%{hashlib.sha256(os.fsencode(name)).hexdigest()}"
    return f"{quoted}.lock"
