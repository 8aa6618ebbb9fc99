"""Table of the pixel that each voxel projects onto, computed once because cameras and grid are static."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._runtime.batching import step_above
from .._runtime.compile_cache import cached_jit
from .._runtime.steps import Steps, finished
from ..cameras import Cameras, nameless, project
from ._blocks import INNER, blocks_of, count_blocks, find_footprints, nowhere, voxels_of
from ._grid import VoxelGrid

# Blocks of voxels projected at once, into one camera: a fixed number, so that another grid does not recompile. In a
# stream, other work waits for so many (3 ms on a slow core). A fourth of it takes half as long again for a whole grid.
_AT_ONCE = 1 << 10


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
        views = (np.asarray(self.pixels_of_blocks) < self.unseen).sum(0)
        return replace(self, observed_of_blocks=jnp.asarray((views >= min_views) & _real(self.grid.shape, len(views))))

    def _by_voxel(self, of_blocks: np.ndarray) -> np.ndarray:
        """Values in grid order, from values in block order."""
        every = np.stack(np.unravel_index(np.arange(self.grid.size), self.grid.shape), 1)
        blocks, places = blocks_of(every, self.grid.shape)
        # Rows are contiguous in memory, in the order in which they are read.
        return of_blocks.reshape(*of_blocks.shape[:-2], -1).take(blocks * INNER + places, axis=-1)

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
    cameras: Cameras, grid: VoxelGrid, height: int, width: int, min_views: int = 2
) -> Steps[ProjectionTable]:
    """As `projection_table`, in steps."""
    blocks = count_blocks(grid.shape)
    pixels = np.full((len(cameras), step_above(blocks), INNER), height * width, np.int32)
    axes = grid.axes()
    # One by one, so that one program does for any rig and any images.
    single = [nameless(cameras[camera : camera + 1]) for camera in range(len(cameras))]
    extent = np.int32(height), np.int32(width)
    # In parts, because all coordinates of a large grid at once would take gigabytes.
    for start in range(0, blocks, _AT_ONCE):
        voxels = voxels_of(np.arange(start, start + _AT_ONCE) % blocks, grid.shape)
        # Voxels of a block outside the grid get the pixel of its first voxel.
        part = np.where(voxels < 0, voxels[:, :1], voxels).reshape(-1)
        points = [axis.take(index) for axis, index in zip(axes, np.unravel_index(part, grid.shape), strict=True)]
        stop = min(start + _AT_ONCE, blocks)
        stacked = np.stack(points, 1)
        for own, camera in zip(pixels, single, strict=True):
            with jax.enable_x64(True):
                found = np.asarray(_pixels(camera, stacked, *extent)).reshape(-1, INNER)
            own[start:stop] = found[: stop - start]
            yield
    footprints = np.empty(pixels.shape[:2], np.int32)
    for own, each in zip(footprints, pixels, strict=True):
        own[:] = find_footprints(each, height, width)
        yield
    cut, none = (footprints == nowhere(height, width)).any(0), jnp.zeros(pixels.shape[1:], bool)
    table = ProjectionTable(grid, jnp.asarray(pixels), none, jnp.asarray(footprints), cut, (height, width))
    return table.with_min_views(min_views)


def _real(shape: tuple[int, ...], blocks: int) -> Bool[np.ndarray, "blocks inner"]:
    """Mask of the voxels of the given number of blocks that lie inside the grid."""
    real = np.zeros((blocks, INNER), bool)
    own = count_blocks(shape)
    real[:own] = voxels_of(np.arange(own), shape) >= 0
    return real


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
