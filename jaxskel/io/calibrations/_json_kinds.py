"""Chooses the reader of a JSON file by its keys."""

from pathlib import Path

from ..files import fault
from . import _anipose_json, _calibio, _multical, _nerf, _open3d, _panoptic, _voxelpose
from ._calibration import Contents
from ._direction import check_direction
from ._json import check_count, read_json
from ._projections import matrices_in, read_projection_table
from ._written_json import cameras_in, read_written

# Largest number of single-camera files in a folder.
_MOST_FILES = 1000
_KINDS = (
    (_open3d.is_open3d, _open3d.read_open3d),
    (_calibio.is_calibio, _calibio.read_calibio),
    (_nerf.is_nerf, _nerf.read_nerf),
    (_multical.is_multical, _multical.read_multical),
    (_voxelpose.is_voxelpose, _voxelpose.read_voxelpose),
    (_anipose_json.is_anipose_list, _anipose_json.read_anipose_list),
)


def read_json_file(path: Path) -> Contents | None:
    """Read a JSON file; None if its format is unknown."""
    table = read_json(path)
    for group in (table, *(table.values() if isinstance(table, dict) else ())):
        if isinstance(group, list | dict):
            check_count(path, len(group))
    # The Panoptic Studio has 521 cameras that look at one person, and the format implies its conventions.
    if _panoptic.is_panoptic(table):
        return _panoptic.read_panoptic(path, table)
    for is_kind, read in _KINDS:
        if is_kind(table):
            contents = read(path, table)
            break
    else:
        cameras = cameras_in(path, table)
        if not cameras:
            matrices = matrices_in(table)
            return read_projection_table(path, matrices) if matrices else None
        contents = read_written(path, table, cameras)
    check_direction(path, contents)
    return contents


def read_json_folder(path: Path, files: list[Path]) -> Contents | None:
    """The cameras of a folder with one file each, named after the files; None if a file holds no camera."""
    if len(files) > _MOST_FILES:
        raise fault(path, None, f"holds {len(files)} JSON files; give a folder with one file a camera, or one of them")
    found = []
    for file in files:
        contents = read_json_file(file)
        if contents is None or len(contents.entries) != 1:
            return None
        found.append(contents)
    kinds = {contents.format for contents in found}
    if len(kinds) != 1:
        raise fault(path, None, f"holds cameras of {' and '.join(sorted(kinds))}; keep those of one format")
    entries = [contents.entries[0] for contents in found]
    whole = Contents(found[0].format, entries, found[0].unit, found[0].up)
    check_direction(path, whole)
    return whole
