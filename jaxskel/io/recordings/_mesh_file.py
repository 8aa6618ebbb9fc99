"""A mesh, such as a scan: one frame, cut into voxels.

Every fault is a `ValueError` of one line that names the file and how to mend it.
"""

import io
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from ...hull import VoxelGrid, make_grid
from ...volumes import Volumes, make_volumes
from ..files import fault, read_bounded

MESHES = (".ply", ".obj", ".stl", ".off")
"""Suffixes of meshes."""
MESH_SPACING = 0.01
"""Edge length of the voxels that a mesh is cut into (m)."""
_MOST_BYTES = 1 << 29
# Largest extent of a person (m), from a crouching child to an adult with outstretched arms.
_EXTENTS = (0.4, 3.0)
# Rows and slices lie this much beside the middle of the voxels along y and z (shares of an edge), because few meshes
# have vertices or edges there. Equal shares would meet the diagonals of squares.
_ASIDE = 1.7e-4, 4.3e-4


def read_mesh_file(path: Path, spacing: float = MESH_SPACING, up: str | None = None) -> Volumes:
    """Read a mesh and cut it into voxels: those whose middle lies inside.

    Args:
        path: The file; its lengths are metres.
        spacing: Edge length of a voxel (m).
        up: World axis that points up; by default +Y or +Z, along which the mesh is longer.

    Raises:
        ValueError: One line that names the file and how to mend it.
    """
    mesh = _loaded(path)
    _check_closed(path, mesh)
    extent = np.ptp(mesh.bounds, axis=0)
    _check_extent(path, float(extent.max()))
    grid = make_grid(mesh.bounds[0] - 2 * spacing, mesh.bounds[1] + 2 * spacing, spacing)
    up = up or ("+Y" if extent[1] > extent[2] else "+Z")
    return make_volumes(_inside(mesh, grid)[None], grid.origin, grid.spacing, up, name=path.stem)


def _loaded(path: Path) -> Any:
    """The mesh, with vertices that lie at the same place made one."""
    try:
        import trimesh
    except ImportError:
        raise ValueError(f'{path}: meshes need trimesh; install it by pip install "jaxskel[mesh]"') from None
    content = read_bounded(path, _MOST_BYTES, "a mesh")
    try:
        # From memory, so that files that it names are not opened.
        mesh: Any = trimesh.load(io.BytesIO(content), file_type=path.suffix[1:].lower(), force="mesh")
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    except Exception as error:  # its readers raise anything on damaged files
        raise fault(
            path, None, f"is no mesh that can be read ({type(error).__name__}: {error}); write it again"
        ) from None
    if len(mesh.faces) == 0 or not np.isfinite(mesh.vertices).all():
        raise fault(path, None, "has no faces, or vertices that are not finite; give a surface of triangles")
    return mesh


def _check_closed(path: Path, mesh: Any) -> None:
    """Refuse a surface with a boundary: each edge must be passed as often in one direction as in the other."""
    edges = np.asarray(mesh.edges)
    _, place = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    excess = np.bincount(place.ravel(), np.where(edges[:, 0] < edges[:, 1], 1.0, -1.0))
    if not excess.any():
        return
    if mesh.is_watertight:
        raise fault(
            path, None, "has triangles that face inwards beside others that face outwards; turn them, for example by "
            "Re-Orient All Faces Coherently in MeshLab, or by trimesh.repair.fix_normals",
        )  # fmt: skip
    raise fault(
        path, None, f"has holes (at {np.count_nonzero(excess)} of {len(excess)} edges a triangle is missing), so it "
        "has no inside; close it, for example by Close Holes or Screened Poisson in MeshLab, or by "
        "trimesh.repair.fill_holes",
    )  # fmt: skip


def _check_extent(path: Path, extent: float) -> None:
    """Refuse what is no person in metres."""
    if _EXTENTS[0] <= extent <= _EXTENTS[1]:
        return
    factor = 10.0 ** np.round(np.log10(1.7 / extent)) if extent > 0 else 1.0
    hint = f"scale it by {factor:g}" if factor != 1 else "give one person"
    raise fault(path, None, f"is {extent:.3g} m long, which no person is; lengths are metres, so {hint}")


def _inside(mesh: Any, grid: VoxelGrid) -> Bool[np.ndarray, "x y z"]:
    """Which voxels have their middle inside: where surfaces are passed more often inwards than outwards."""
    from trimesh.intersections import mesh_multiplane

    x, y, z = grid.axes()
    occupied = np.zeros(grid.shape, bool)
    slices, to_world, faces = mesh_multiplane(
        mesh, np.zeros(3), np.array([0.0, 0.0, 1.0]), z + _ASIDE[1] * grid.spacing
    )
    for layer, (segments, back, owners) in enumerate(zip(slices, to_world, faces, strict=True)):
        if len(segments):
            ends = segments @ back[:2, :2].T + back[:2, 3]
            occupied[:, :, layer] = _filled(ends, mesh.face_normals[owners, 0], x, y + _ASIDE[0] * grid.spacing)
    return occupied


def _filled(
    ends: Float[np.ndarray, "segments 2 xy=2"],
    outwards: Float[np.ndarray, " segments"],
    x: Float[np.ndarray, " x"],
    y: Float[np.ndarray, " y"],
) -> Bool[np.ndarray, "x y"]:
    """Which points of a slice lie inside its outlines; `outwards` is the x component of each segment's normal."""
    one, other = ends[:, 0], ends[:, 1]
    row, segment = np.nonzero((one[:, 1] <= y[:, None]) != (other[:, 1] <= y[:, None]))
    start, along = one[segment], other[segment] - one[segment]
    passed = start[:, 0] + along[:, 0] * (y[row] - start[:, 1]) / along[:, 1]
    turns = np.zeros((len(x) + 1, len(y)))
    np.add.at(turns, (np.searchsorted(x, passed), row), np.sign(outwards[segment]))
    return np.cumsum(turns, axis=0)[:-1] != 0
