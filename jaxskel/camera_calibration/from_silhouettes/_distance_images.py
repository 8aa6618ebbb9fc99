"""Signed distance images of silhouettes, interpolated anywhere; their zero is the outline at subpixel accuracy."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from ..._runtime.compile_cache import cached_jit
from ...cameras import Cameras
from ...outlines import signed_distances
from ...recording import person_boxes

# Largest number of grid values along a side of an image; values in between are interpolated.
_MOST_CELLS = 640
# Newton steps to the zero of a distance, whose slope is nearly one.
_STEPS = 3


class DistanceImages(eqx.Module):
    """Signed distances (px) to the outlines of silhouettes on regular grids, negative inside the person.

    Attributes:
        values: Grid values, ordered by frame, then by view.
        step: Spacing of the grid (px).
        size: Width and height (px) of the known part of each image: zero for a view that has lost the person.
    """

    values: Float[Array | np.ndarray, "images rows columns"]
    step: Int[Array | np.ndarray, ""]
    size: Int[Array | np.ndarray, "images 2"]

    def at(
        self, image: Int[Array, "*points"], u: Float[Array, "*points"], v: Float[Array, "*points"]
    ) -> tuple[Float[Array, "*points"], Bool[Array, "*points"]]:
        """Distances at image points (px), and whether these points are seen; 0 if not.

        A point is seen if it lies inside the image. Bilinear, so differentiable almost everywhere.
        """
        size = jnp.asarray(self.size)[image]
        # NaN, for points that a camera cannot see, compares false.
        seen = (u > -0.5) & (v > -0.5) & (u < size[..., 0] - 0.5) & (v < size[..., 1] - 0.5)
        rows, columns = self.values.shape[1:]
        # Grid values are means over cells of `step` pixels.
        x, y = ((jnp.where(seen, a, 0.0) + 0.5) / self.step - 0.5 for a in (u, v))
        x, y = jnp.clip(x, 0.0, columns - 1.001), jnp.clip(y, 0.0, rows - 1.001)
        column, row = jnp.floor(x).astype(jnp.int32), jnp.floor(y).astype(jnp.int32)
        x, y = x - column, y - row
        first = (image * rows + row) * columns + column
        values = jnp.asarray(self.values).reshape(-1)
        a, b, c, d = (values.at[first + by].get(mode="clip") for by in (0, 1, columns, columns + 1))
        distance = (a * (1 - x) + b * x) * (1 - y) + (c * (1 - x) + d * x) * y
        return jnp.where(seen, distance, 0.0), seen


def cell_size(silhouettes: UInt8[np.ndarray, "*stack h w8"]) -> int:
    """Grid spacing of the distance images of these silhouettes (px)."""
    return -(-max(silhouettes.shape[-2], 8 * silhouettes.shape[-1]) // _MOST_CELLS)


def distance_images(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    empty_views: Bool[np.ndarray, "frames cams"],
    farthest: int,
) -> DistanceImages:
    """Compute the distance images of some frames.

    Args:
        silhouettes: Packed bits.
        cameras: The rig.
        empty_views: Views that show no person.
        farthest: Distances are exact up to this, and clipped to it (px).
    """
    frames, views, height, width = *silhouettes.shape[:3], 8 * silhouettes.shape[3]
    step = cell_size(silhouettes)
    values = np.zeros((frames, views, -(-height // step), -(-width // step)), np.float32)
    for frame, view in zip(*np.nonzero(~empty_views), strict=True):
        right, low = cameras.size[view].tolist()
        packed = silhouettes[frame, view, :low]
        cells = signed_distances(packed, right, step, farthest, fine=True)
        cells = np.minimum(cells, _to_cut_edges(packed, right, step, cells.shape))
        values[frame, view, : len(cells), : cells.shape[1]] = cells
    size = np.where(empty_views[..., None], 0, cameras.size).astype(np.int32)
    return DistanceImages(values.reshape(-1, *values.shape[2:]), np.array(step, np.int32), size.reshape(-1, 2))


def _to_cut_edges(
    packed: UInt8[np.ndarray, "h w8"], across: int, step: int, shape: tuple[int, int]
) -> Float[np.ndarray, "rows columns"]:
    """Distance of grid cells (px) from the image edges that cut the person off; infinite if none does.

    Outside such an edge the person may be anywhere. So no cell is known to be farther from the person than from the
    edge: without this, a ray just inside the edge would miss body parts just outside.
    """
    found = np.full(shape, np.inf, np.float32)
    box = person_boxes(packed)[0]
    if box is None:
        return found
    top, bottom, left, right = box
    v, u = (step * (np.arange(count, dtype=np.float32) + 0.5) for count in shape)
    for cut, way in (
        (top == 0, v[:, None]),
        (bottom == len(packed), len(packed) - v[:, None]),
        (left == 0, u[None]),
        (right == across, across - u[None]),
    ):
        if cut:
            # The last cell of an image may be partial.
            found = np.minimum(found, np.maximum(way, 0.0))
    return found


@cached_jit
def onto_outlines(
    images: DistanceImages, image: Int[Array | np.ndarray, " points"], uv: Float[Array | np.ndarray, "points 2"]
) -> Float[Array, "points 2"]:
    """Move points (px) near the outlines of some images to where the distance is zero, at subpixel accuracy."""

    def one(image: Int[Array, ""], uv: Float[Array, "2"]) -> Float[Array, "2"]:
        for _ in range(_STEPS):
            distance, slope = jax.value_and_grad(lambda p: images.at(image, p[0], p[1])[0])(uv)
            # On ridges and in corners the slope vanishes: limit the step to twice the distance.
            uv = uv - distance * slope / jnp.maximum((slope * slope).sum(), 0.25)
        return uv

    return jax.vmap(one)(jnp.asarray(image), jnp.asarray(uv))
