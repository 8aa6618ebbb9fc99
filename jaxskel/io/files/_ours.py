"""Which files jaxskel wrote: only these are replaced where a command chooses the name itself."""

import re
from pathlib import Path

from ..._runtime.picture_files import SIGNATURE
from ._archive import keys_of
from ._bounded import open_regular

TOML_LINE = "# Written by jaxskel."
"""First line of the TOML files that are written."""

_POSES = {"joints", "tips", "confidence", "side_confidence", "status", "status_names", "frame_index"}
# Only of the scene of `jaxskel demo`: other sequence files are somebody's recordings, whoever wrote them.
_NOTE = "made_by"
# What the files begin with, by their suffix; those of earlier versions too, but for pictures and TOML.
_BEGINNINGS = {
    ".csv": re.compile(rb"frame_index,time_s,status,"),
    ".json": re.compile(rb'\{\s*"frames": \d+,\s*"frames_without_pose": '),
    ".html": re.compile(rb"(?s)<!DOCTYPE html>.* \xe2\x80\x93 jaxskel</title>"),
    ".toml": re.compile(re.escape(TOML_LINE.encode())),
    ".png": re.compile(rb"(?s)\x89PNG.*" + re.escape(SIGNATURE)),
}
_BEGINNING = 4096  # bytes


def is_ours(path: Path) -> bool:
    """Whether a file holds what jaxskel writes under such a name."""
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
