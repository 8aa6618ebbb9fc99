"""Volumes: the occupied voxels of each frame, in memory or read when they are needed, and where they lie."""

from abc import ABC, abstractmethod
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int

from .._runtime.kinds import check_kind, told
from ..body import Skeleton
from ..hull import VisualHulls, VoxelGrid, check_spacing, hulls_from_dense
from ..recording import Truth, rotation_to_z_up

# No volume is farther from the origin of its world (m). Single precision has steps of 0.01 mm there, and an origin in
# millimetres is farther away.
_FARTHEST = 100.0


class AbstractOccupancy(ABC):
    """Occupied voxels of frames that are stored elsewhere.

    Attributes:
        shape: Frames, then voxels along x, y and z.
    """

    shape: tuple[int, int, int, int]

    @abstractmethod
    def read(self, frames: Int[np.ndarray, " some"]) -> Bool[np.ndarray, "some x y z"]:
        """Read some frames, in ascending order."""


class Volumes(eqx.Module):
    """The occupied voxels of a person in each frame. Make them with [`make_volumes`][].

    Attributes:
        grid: Where the voxels lie in the world of `up` (m).
        up: World axis that points up.
        fps: Frames per second.
        frame_index: Number of each frame in the original material.
        skeleton: The subject's dimensions, if known.
    """

    occupied: Bool[np.ndarray, "frames x y z"] | AbstractOccupancy
    grid: VoxelGrid
    up: str
    fps: float
    frame_index: Int[np.ndarray, " frames"]
    skeleton: Skeleton | None = None
    truth: Truth | None = None
    name: str = "volumes"

    def __len__(self) -> int:
        return self.occupied.shape[0]


def make_volumes(
    occupied: Any,
    origin: Any,
    spacing: Any,
    up: str = "+Z",
    fps: float = 30.0,
    frame_index: Any = None,
    skeleton: Skeleton | None = None,
    truth: Truth | None = None,
    name: str = "volumes",
) -> Volumes:
    """Check voxels and where they lie.

    Args:
        occupied: Which voxels are occupied: booleans, ``(frames, x, y, z)``.
        origin: Lower corner of the first voxel, ``(3,)`` (m, world).
        spacing: Edge length of a voxel (m).
        up: World axis that points up.
        fps: Frames per second.
        frame_index: Number of each frame; by default counted from 0.
        skeleton: The subject's dimensions, if known.
        truth: True joints, for scoring only.
        name: Of the material, for messages.

    Raises:
        ValueError: One line that names the argument.
    """
    if not isinstance(occupied, AbstractOccupancy):
        check_kind("occupied", occupied, np.ndarray, "a NumPy array of booleans, (frames, x, y, z)")
        if occupied.ndim != 4:
            hint = "; occupied[None] for a single frame" if occupied.ndim == 3 else ""
            raise ValueError(f"occupied: has shape {occupied.shape}; give (frames, x, y, z){hint}")
        if occupied.dtype != np.bool_:
            raise ValueError(f"occupied: holds {occupied.dtype}; give booleans, for example occupied > 0")
    frames, x, y, z = shape = tuple(int(n) for n in occupied.shape)
    if 0 in shape:
        raise ValueError(f"occupied: has shape {shape}; give at least one frame and one voxel")
    if np.ndim(spacing) != 0:
        raise ValueError(
            f"spacing: has shape {np.shape(spacing)}; give one edge length (m), and resample voxels that are no cubes"
        )
    spacing = spacing.item() if isinstance(spacing, np.ndarray) else spacing
    check_spacing(spacing)
    grid = VoxelGrid(_origin(origin), float(spacing), (x, y, z))
    if isinstance(fps, bool) or not isinstance(fps, int | float | np.number) or not 0 < fps < np.inf:
        raise ValueError(f"fps: is {fps!r}; give a positive number of frames per second")
    check_kind("up", up, str, "an axis, such as '+Z'")
    rotation_to_z_up(up)  # refuses what is no axis
    check_kind("skeleton", skeleton, Skeleton | None, "a Skeleton, such as default_adult(1.75), or None")
    return Volumes(occupied, grid, up, float(fps), _numbers(frame_index, frames), skeleton, truth, name)


def hulls_of(volumes: Volumes, frames: Int[np.ndarray, " some"]) -> VisualHulls:
    """The voxels of some frames, given in ascending order, as hulls in a world with z up."""
    given = volumes.occupied
    dense = given.read(frames) if isinstance(given, AbstractOccupancy) else given[frames]
    rotation = rotation_to_z_up(volumes.up)
    turned = dense.transpose(0, *(1 + _axes(rotation)))
    turned = turned[(slice(None), *(slice(None, None, int(sign)) for sign in rotation.sum(1)))]
    return hulls_from_dense(turned, upright_grid(volumes))


def upright_grid(volumes: Volumes) -> VoxelGrid:
    """Where the voxels lie in a world with z up."""
    rotation, grid = rotation_to_z_up(volumes.up), volumes.grid
    corners = np.stack([np.asarray(grid.origin), grid.upper]) @ rotation.T
    x, y, z = np.array(grid.shape)[_axes(rotation)].tolist()
    return VoxelGrid(corners.min(0), grid.spacing, (x, y, z))


def _axes(rotation: Float[np.ndarray, "3 3"]) -> Int[np.ndarray, "3"]:
    """Which axis becomes x, y and z: the rotation only exchanges axes and turns them round."""
    return np.abs(rotation).argmax(1)


def _origin(origin: Any) -> Float[np.ndarray, "3"]:
    try:
        found = np.asarray(origin, np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"origin: is {told(origin)}; give the lower corner of the first voxel, x, y, z (m)") from None
    if found.shape != (3,):
        raise ValueError(f"origin: has shape {found.shape}; give the lower corner of the first voxel, x, y, z (m)")
    if not (np.abs(found) <= _FARTHEST).all():
        raise ValueError(
            f"origin: is {', '.join(f'{value:g}' for value in found)} m; give metres, at most {_FARTHEST:.0f} from the "
            "origin of the world, so divide by 1000 if these are millimetres"
        )
    return found


def _numbers(frame_index: Any, frames: int) -> Int[np.ndarray, " frames"]:
    found = np.arange(frames) if frame_index is None else np.asarray(frame_index)
    if found.shape != (frames,) or found.dtype.kind not in "iu":
        raise ValueError(
            f"frame_index: is {found.dtype} of shape {found.shape}; give {frames} whole numbers, one for each frame"
        )
    return found.astype(np.int64)
