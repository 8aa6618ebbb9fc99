"""Recognises files that jaxskel wrote: only these are replaced if a command chooses the name itself."""

import re
from pathlib import Path

from ..._runtime.picture_files import SIGNATURE
from ._archive import keys_of
from ._bounded import open_regular

TOML_LINE = "# Written by jaxskel."
"""First line of the TOML files that jaxskel writes."""

_POSES = {"joints", "tips", "confidence", "side_confidence", "status", "status_names", "frame_index"}
# Only the scene of `jaxskel demo` has this key; other sequence files are recordings of the user, whoever wrote them.
_NOTE = "made_by"
# First bytes of the files, by suffix; also those of earlier versions, except for pictures and TOML.
_BEGINNINGS = {
    ".csv": re.compile(rb"frame_index,time_s,status,"),
    ".json": re.compile(rb'\{\s*"frames": \d+,\s*"frames_without_pose": '),
    ".html": re.compile(rb"(?s)<!DOCTYPE html>.* \xe2\x80\x93 jaxskel</title>"),
    ".toml": re.compile(re.escape(TOML_LINE.encode())),
    ".png": re.compile(rb"(?s)\x89PNG.*" + re.escape(SIGNATURE)),
}
_BEGINNING = 4096  # bytes that are read


def is_ours(path: Path) -> bool:
    """Whether a file holds what jaxskel writes under this suffix."""
    try:
        if path.suffix == ".npz":
            keys = set(keys_of(path))
            return keys >= _POSES or _NOTE in keys
        with open_regular(path) as file:
            start = file.read(_BEGINNING)
    except (ValueError, OSError):
        return False
    wanted = _BEGINNINGS.get(path.suffix)
    return wanted is not None and wanted.match(start or b"") is not None
