"""Reads recordings from disk: a sequence file, a folder, or volumes as virtual cameras see them."""

from pathlib import Path

from ..._runtime.kinds import check_kind
from ...recording import Recording
from ...volumes import seen_by_virtual_cameras
from ._folders import RECORDING_FILE, read_folder
from ._sequence_file import IN_MEMORY, read_sequence_file
from ._volumes import holds_volumes, read_volumes


def read_recording(path: str | Path, in_memory: int = IN_MEMORY, up: str | None = None) -> Recording:
    """Read a sequence file (see `_sequence_file.py`) or a folder with a `recording.toml` (see `_folders.py`).

    Voxels and meshes, see `read_volumes`, are rendered into virtual cameras around them.

    Args:
        path: The file, or the folder.
        in_memory: Packed silhouettes larger than this (bytes) do not stay in memory: those of a sequence file are read
            when they are needed, those of a folder go into a temporary file.
        up: World axis that points up in voxels or a mesh, see `read_volumes`; other recordings say their own.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    check_kind("path", path, str | Path, "the path of a file or of a folder")
    check_kind("up", up, str | None, "an axis, such as '+Z', or None")
    path = Path(path)
    if up is not None and not holds_volumes(path):
        raise ValueError(f"up: is for voxels and meshes, but {path} says its own; leave it out")
    if path.is_dir():
        return read_folder(path, in_memory)
    if path.name == RECORDING_FILE:
        return read_folder(path.parent, in_memory)
    if holds_volumes(path):
        return seen_by_virtual_cameras(read_volumes(path, up=up))
    return read_sequence_file(path, in_memory)
