"""Table of the pixel that each voxel projects onto, computed once because cameras and grid are static."""

import math
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._runtime.batching import step_above
from .._runtime.compile_cache import cached_jit
from .._runtime.steps import Steps, finished
from .._runtime.taken_over import unwritten
from ..cameras import Cameras, nameless, project
from ._blocks import EDGE, INNER, blocks_of, count_blocks, find_footprints, grid_of_blocks, nowhere, voxels_of
from ._grid import VoxelGrid

# Blocks of voxels projected at once, into one camera: a fixed number, so that another grid does not recompile. In a
# stream, other work waits for so many (3 ms on a slow core). A fourth of it takes half as long again for a whole grid.
_AT_ONCE = 1 << 10
# Blocks copied from another table at once, for one camera: they take as long as those that are projected.
_COPIED = 1 << 13
# Two grids share their voxels if one begins a whole number of blocks after the other, but for rounding (blocks).
_ALIGNED = 1e-6


class ProjectionTable(eqx.Module):
    """Which pixel each voxel centre projects onto, for static cameras and a static grid.

    Attributes:
        pixels_of_blocks: The `pixels` in block order, see `voxels_of`, padded with unused blocks: grids of similar size
            share compiled code.
        footprints: Footprint of each block in each camera, see `find_footprints`.
        cut_blocks: Mask of the blocks that some camera may see only in part.
        size: Height and width of the stored silhouettes (px).
    """

    grid: VoxelGrid
    pixels_of_blocks: Int[Array, "cams at_least_blocks inner"]
    observed_of_blocks: Bool[Array, "at_least_blocks inner"]
    footprints: Int[Array, "cams at_least_blocks"]
    cut_blocks: Bool[np.ndarray, " at_least_blocks"]
    size: tuple[int, int] = eqx.field(static=True)

    @property
    def pixels(self) -> Int[np.ndarray, "cams voxels"]:
        """Index into the flattened image; one past its end where the camera does not see the voxel."""
        return self._by_voxel(np.asarray(self.pixels_of_blocks))

    @property
    def observed(self) -> Bool[np.ndarray, " voxels"]:
        """Whether enough cameras see the voxel to tell it from the background."""
        return self._by_voxel(np.asarray(self.observed_of_blocks))

    def pixels_at(self, voxels: Int[np.ndarray, "n 3"]) -> Int[np.ndarray, "cams n"]:
        """The `pixels` of some voxels, given by their grid indices x, y, z."""
        block, place = blocks_of(voxels, self.grid.shape)
        table = np.asarray(self.pixels_of_blocks)
        return table.reshape(len(table), -1).take(block * INNER + place, axis=1)

    def partly_seen(self, voxels: Int[np.ndarray, "n 3"]) -> Int[np.ndarray, " some"]:
        """Indices of the given voxels whose blocks some camera may see only in part."""
        return np.flatnonzero(self.cut_blocks.take(blocks_of(voxels, self.grid.shape)[0]))

    def with_min_views(self, min_views: int) -> "ProjectionTable":
        """The same table with another minimum number of cameras that see a voxel."""
        observed, blocks = np.zeros(self.observed_of_blocks.shape, bool), count_blocks(self.grid.shape)
        pixels = np.asarray(self.pixels_of_blocks)
        observed[:blocks] = _observed(pixels, 0, blocks, self.grid.shape, self.unseen, min_views)
        return replace(self, observed_of_blocks=jnp.asarray(observed))

    def _by_voxel(self, of_blocks: np.ndarray) -> np.ndarray:
        """Values in grid order, from values in block order."""
        blocks, lead = grid_of_blocks(self.grid.shape), of_blocks.shape[:-2]
        inner = of_blocks[..., : math.prod(blocks), :].reshape(*lead, *blocks, EDGE, EDGE, EDGE)
        first = len(lead)
        order = [*range(first), *(first + axis + part for axis in range(3) for part in (0, 3))]
        whole = inner.transpose(order).reshape(*lead, *(EDGE * count for count in blocks))
        x, y, z = (slice(count) for count in self.grid.shape)
        return whole[..., x, y, z].reshape(*lead, -1)

    @property
    def unseen(self) -> int:
        """The pixel index that means "not seen": the number of pixels of an image."""
        return self.size[0] * self.size[1]


def projection_table(cameras: Cameras, grid: VoxelGrid, height: int, width: int, min_views: int = 2) -> ProjectionTable:
    """Project every voxel centre of a grid into every camera, in float64.

    A voxel projects onto the pixel with the nearest centre (halves round up). A camera does not see voxels that are
    behind it or outside its image.

    Args:
        cameras: The rig, in the grid's world.
        grid: The voxels.
        height: Height of the stored silhouettes (px); the images of all cameras fit into it.
        width: Width of the stored silhouettes (px), a multiple of 8.
        min_views: A voxel seen by fewer cameras than this is never occupied, because nothing bounds it.
    """
    return finished(projecting(cameras, grid, height, width, min_views))


def projecting(
    cameras: Cameras, grid: VoxelGrid, height: int, width: int, min_views: int = 2, known: ProjectionTable | None = None
) -> Steps[ProjectionTable]:
    """As `projection_table`, in steps.

    Args:
        cameras: As for `projection_table`, as all below.
        grid: The voxels.
        height: Height of the stored silhouettes (px).
        width: Width of the stored silhouettes (px), a multiple of 8.
        min_views: Cameras that must see an occupied voxel.
        known: A table of the same cameras and images; blocks that its grid has too are copied. A person who walks
            15 cm leaves nine tenths of a stream's grid as they are.
    """
    blocks, unseen = count_blocks(grid.shape), height * width
    # Not filled at once: new memory costs time where it is first written to, which is in small steps here.
    pixels = unwritten((len(cameras), step_above(blocks), INNER), np.int32)
    pixels[:, blocks:] = unseen
    footprints = np.full(pixels.shape[:2], nowhere(height, width), np.int32)
    same = np.full(blocks, -1) if known is None else _same_blocks(known, grid, (height, width))
    yield from _project(cameras, grid, np.flatnonzero(same < 0), (height, width), pixels, footprints)
    if known is not None:
        yield from _copy(known, same, pixels, footprints)
    observed = np.zeros(pixels.shape[1:], bool)
    for start in range(0, blocks, _COPIED):
        stop = min(start + _COPIED, blocks)
        observed[start:stop] = _observed(pixels, start, stop, grid.shape, unseen, min_views)
        yield
    cut = (footprints == nowhere(height, width)).any(0)
    kept, seen, cells = (jax.device_put(array) for array in (pixels, observed, footprints))
    return ProjectionTable(grid, kept, seen, cells, cut, (height, width))


def _project(
    cameras: Cameras,
    grid: VoxelGrid,
    blocks: Int[np.ndarray, " some"],
    size: tuple[int, int],
    pixels: Int[np.ndarray, "cams at_least_blocks inner"],
    footprints: Int[np.ndarray, "cams at_least_blocks"],
) -> Steps[None]:
    """Fill in the pixels and footprints of some blocks, in steps."""
    axes, extent = grid.axes(), (np.int32(size[0]), np.int32(size[1]))
    # One by one, so that one program does for any rig and any images.
    single = [nameless(cameras[camera : camera + 1]) for camera in range(len(cameras))]
    # In parts, because all coordinates of a large grid at once would take gigabytes.
    for start in range(0, len(blocks), _AT_ONCE):
        part = blocks[start : start + _AT_ONCE]
        voxels = voxels_of(np.resize(part, _AT_ONCE), grid.shape)
        # Voxels of a block outside the grid get the pixel of its first voxel.
        inside = np.where(voxels < 0, voxels[:, :1], voxels).reshape(-1)
        points = [axis.take(index) for axis, index in zip(axes, np.unravel_index(inside, grid.shape), strict=True)]
        stacked = np.stack(points, 1)
        for own, cells, camera in zip(pixels, footprints, single, strict=True):
            with jax.enable_x64(True):
                found = np.asarray(_pixels(camera, stacked, *extent)).reshape(-1, INNER)[: len(part)]
            own[part], cells[part] = found, find_footprints(found, *size)
            yield


def _copy(
    known: ProjectionTable,
    same: Int[np.ndarray, " blocks"],
    pixels: Int[np.ndarray, "cams at_least_blocks inner"],
    footprints: Int[np.ndarray, "cams at_least_blocks"],
) -> Steps[None]:
    """Copy the pixels and footprints of the blocks that another table has, see `_same_blocks`, in steps."""
    before = np.asarray(known.pixels_of_blocks), np.asarray(known.footprints)
    blocks = np.flatnonzero(same >= 0)
    for start in range(0, len(blocks), _COPIED):
        part = blocks[start : start + _COPIED]
        for own, cells, theirs, their_cells in zip(pixels, footprints, *before, strict=True):
            own[part], cells[part] = theirs.take(same[part], 0), their_cells.take(same[part])
            yield


def _same_blocks(known: ProjectionTable, grid: VoxelGrid, size: tuple[int, int]) -> Int[np.ndarray, " blocks"]:
    """For each block of a grid, the one of the table's grid with the same voxels; -1 where there is none."""
    shapes, other = (grid.shape, known.grid.shape), known.grid
    away = (np.asarray(grid.origin) - np.asarray(other.origin)) / (EDGE * grid.spacing)
    shift = np.round(away).astype(int)
    ragged = any(count % EDGE for shape in shapes for count in shape)
    if ragged or known.size != size or grid.spacing != other.spacing or np.abs(away - shift).max() > _ALIGNED:
        return np.full(count_blocks(grid.shape), -1)
    at = np.indices(grid_of_blocks(grid.shape)) + shift[:, None, None, None]
    blocks = grid_of_blocks(other.shape)
    inside = ((at >= 0) & (at < np.reshape(blocks, (3, 1, 1, 1)))).all(0)
    return np.where(inside, (at[0] * blocks[1] + at[1]) * blocks[2] + at[2], -1).reshape(-1)


def _observed(
    pixels: Int[np.ndarray, "cams at_least_blocks inner"],
    start: int,
    stop: int,
    shape: tuple[int, ...],
    unseen: int,
    min_views: int,
) -> Bool[np.ndarray, "some inner"]:
    """Mask of the voxels of a range of blocks that lie inside the grid and that enough cameras see."""
    views = np.add.reduce(pixels[:, start:stop] < unseen, 0, np.uint16)
    return (views >= min_views) & (voxels_of(np.arange(start, stop), shape) >= 0)


@cached_jit
def _pixels(
    camera: Cameras,
    points: Float[Array | np.ndarray, "n 3"],
    height: Int[Array, ""] | np.int32,
    width: Int[Array, ""] | np.int32,
) -> Int[Array, " n"]:
    """The pixels of one camera that points in the world (m) project onto, as in `ProjectionTable`."""
    u, v, _ = (each[0] for each in project(camera, points))
    u, v = jnp.floor(u + 0.5), jnp.floor(v + 0.5)
    # NaN, where the camera sees nothing, compares false.
    seen = (u >= 0) & (v >= 0) & (u < camera.size[0, 0]) & (v < camera.size[0, 1])
    return jnp.where(seen, v * width + u, height * width).astype(jnp.int32)
