"""Where the cameras see the voxels of a grid: looked up once, because cameras and grid are static."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ._blocks import find_footprints
from ._camera import Cameras, project
from ._grid import VoxelGrid
from ._kept import kept

# Voxels that are projected at once: always the same number, so that another grid does not compile again.
_AT_ONCE = 1 << 16


class ProjectionTable(eqx.Module):
    """Which pixel each voxel centre falls on, for static cameras and a static grid."""

    grid: VoxelGrid
    padded_pixels: Int[Array, "cams at_least_voxels"]
    """The `pixels`, and more that nobody looks at: grids of about the same size share what is compiled."""
    padded_observed: Bool[Array, " at_least_voxels"]
    padded_footprints: Int[Array, "cams at_least_blocks"]
    """Where each camera sees each block of voxels, see `find_footprints`; and more."""
    size: tuple[int, int] = eqx.field(static=True)
    """Height and width of the stored silhouettes (px)."""

    @property
    def pixels(self) -> Int[np.ndarray, "cams voxels"]:
        """Index into the flattened image; one past its end where the camera does not see the voxel."""
        return np.asarray(self.padded_pixels)[:, : self.grid.size]

    @property
    def observed(self) -> Bool[np.ndarray, " voxels"]:
        """Seen by enough cameras to be told from the background."""
        return np.asarray(self.padded_observed)[: self.grid.size]

    def with_observed(self, observed: Bool[np.ndarray, " voxels"]) -> "ProjectionTable":
        """The same table, but for the voxels that count as observed."""
        missing = self.padded_observed.shape[0] - len(observed)
        return replace(self, padded_observed=jnp.asarray(np.pad(observed, (0, missing))))

    @property
    def unseen(self) -> int:
        """The index of "not seen": the number of pixels of an image."""
        return self.size[0] * self.size[1]


def projection_table(cameras: Cameras, grid: VoxelGrid, height: int, width: int, min_views: int = 2) -> ProjectionTable:
    """Project every voxel centre of a grid into every camera, in float64.

    A voxel falls on the pixel whose centre is nearest (halves round up). It is not seen by a camera that it lies
    behind, or whose image it falls outside of.

    Args:
        cameras: The rig.
        grid: The voxels.
        height: Height of the stored silhouettes (px); the images of all cameras fit into it.
        width: Width of the stored silhouettes (px), a multiple of 8.
        min_views: A voxel seen by fewer cameras than this is never occupied: nothing bounds it.
    """
    pixels = np.full((len(cameras), _step_above(grid.size)), height * width, np.int32)
    axes = grid.axes()
    # Names are no numbers, and other names would compile again.
    nameless = replace(cameras, names=tuple(map(str, range(len(cameras)))))
    # Part by part, because all coordinates of a large grid at once would take gigabytes.
    with jax.enable_x64(True):
        for start in range(0, grid.size, _AT_ONCE):
            part = np.arange(start, start + _AT_ONCE) % grid.size
            points = [axis.take(index) for axis, index in zip(axes, np.unravel_index(part, grid.shape), strict=True)]
            found = np.asarray(_pixels(nameless, np.stack(points, 1), height, width))
            stop = min(start + _AT_ONCE, grid.size)
            pixels[:, start:stop] = found[:, : stop - start]
    seen_by = (pixels < height * width).sum(0)
    footprints = np.stack([find_footprints(each[: grid.size], grid.shape, height, width) for each in pixels])
    footprints = np.pad(footprints, ((0, 0), (0, _step_above(footprints.shape[1]) - footprints.shape[1])))
    observed = seen_by >= min_views
    return ProjectionTable(grid, jnp.asarray(pixels), jnp.asarray(observed), jnp.asarray(footprints), (height, width))


def _step_above(count: int) -> int:
    """A number that is not less, and at most a quarter more; there are four to each power of two."""
    step = max(1, 2 ** (count.bit_length() - 3))
    return -(-count // step) * step


@kept
def _pixels(
    cameras: Cameras, points: Float[Array | np.ndarray, "n 3"], height: int, width: int
) -> Int[Array, "cams n"]:
    """The pixels that points (m) fall on, as `ProjectionTable` has them."""
    u, v, _ = project(cameras, points)
    u, v = jnp.floor(u + 0.5), jnp.floor(v + 0.5)
    # NaN, where the camera sees nothing, compares false.
    seen = (u >= 0) & (v >= 0) & (u < cameras.size[:, 0, None]) & (v < cameras.size[:, 1, None])
    return jnp.where(seen, v * width + u, height * width).astype(jnp.int32)
