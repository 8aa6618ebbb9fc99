"""Reads volumes from disk: a voxel file or a mesh."""

from pathlib import Path

from ..._runtime.kinds import check_kind
from ...volumes import Volumes
from ..files import keys_of
from ._mesh_file import MESH_SPACING, MESHES, read_mesh_file
from ._voxel_file import read_voxel_file


def holds_volumes(path: Path) -> bool:
    """Whether a file is a mesh, or holds voxels but no silhouettes; not if it is too damaged to tell."""
    if path.suffix.lower() in MESHES:
        return True
    try:
        keys = keys_of(path)
    except ValueError:
        return False
    return "occupied" in keys and "silhouettes" not in keys


def read_volumes(path: str | Path, spacing: float = MESH_SPACING, up: str | None = None) -> Volumes:
    """Read a voxel file (see `_voxel_file.py`) or a mesh (see `_mesh_file.py`).

    Args:
        path: The file.
        spacing: Edge length of the voxels that a mesh is cut into (m); a voxel file has its own.
        up: World axis that points up; by default what the file says, or how a mesh is longest.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    check_kind("path", path, str | Path, "the path of a file")
    check_kind("up", up, str | None, "an axis, such as '+Z', or None")
    path = Path(path)
    return read_mesh_file(path, spacing, up) if path.suffix.lower() in MESHES else read_voxel_file(path, up)
