"""Signed distances to the silhouettes, view by view: where the body may be according to each single view.

A hull is only as good as its worst view: one hole in one mask carves a tunnel through the person. Here each view counts
separately, and an objective can be robust to views that err.
"""

from typing import TypeVar

import cv2
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from .._runtime.batching import aligned
from .._runtime.materialise import computed_once
from ..cameras import Cameras, apparent_depth, in_cameras, lens_slopes, on_images, rig_size, with_blind_cameras
from ..recording import Box, person_boxes, unpacked_box

T = TypeVar("T")

# Largest number of values along a side of the image: finer grids give no more information.
_MOST_CELLS = 320
# Distances (px) are exact up to this value, and clipped there.
_FARTHEST = 40
# Standard deviation of the Gaussian for local means (px), and the distance from the outline (px) within which they
# replace the distance transform; they fade out at twice that distance.
_SMOOTHING, _NEAR = 0.7, 1.5
# Pixels along a side of a cell from which distances are computed: large images are made smaller before. (The eight
# views of a real recording, 1600 px wide: outlines move by 0.1 px, without bias, in 12 ms instead of 30.)
_PIXELS = 2
# Value where a view has no information (m): well inside.
_NOTHING = -1.0
# All values of an empty view (px): far inside everywhere.
_LOST = -1e3


class SilhouetteDistances(eqx.Module):
    """Signed distance to the outline of each silhouette, on a regular grid of its image: negative on the person.

    Attributes:
        values: Distances (px), row by row, with the leading axes of the other fields, or those of a stack, see `frame`.
            There is space for images of every shape; what is beyond the last row has no meaning.
        shape: Number of rows and columns of the grid.
        step: Spacing of the values (px).
        cameras: The rig, in the working world, with the same leading axes; after its cameras come some that see
            nothing, so that rigs of similar size share compiled code.
        misses: Number of views that may err at any point.
        frame: Index of this frame if it is one of a stack; `values` are then still those of all frames.
    """

    values: Float[Array | np.ndarray, "*stack cams cells"]
    shape: Int[Array | np.ndarray, "*frames 2"]
    step: Float[Array | np.ndarray, "*frames"]
    cameras: Cameras
    misses: Int[Array | np.ndarray, "*frames"]
    frame: Int[Array, ""] | None = None

    def of(self, frame: Int[Array, ""]) -> "SilhouetteDistances":
        """One frame of a stack on the device; the large array of values is shared, not copied."""
        given = self.shape, self.step, self.cameras, self.misses
        shape, step, cameras, misses = jax.tree.map(lambda a: a[frame], given)
        return SilhouetteDistances(self.values, shape, step, cameras, misses, frame)

    def at(self, points: Float[Array, "points 3"]) -> Float[Array, "cams points"]:
        """Distances at points in the world (m, at the depth of each point, see `apparent_depth`), for one frame.

        Well inside (-1 m) where a view has no information: outside its image, behind it, or if it shows no person.
        """
        u, v, depth = self._seen(points)
        seen, distance, _ = self._interpolated(u, v)
        return self._in_metres(seen, distance, depth)

    def seen_at(
        self, points: Float[Array, "points 3"]
    ) -> tuple[Bool[Array, "cams points"], Float[Array, "cams points"]]:
        """Whether points in the world (m) fall into each image, and the distances there, as from `at` (m)."""
        u, v, depth = self._seen(points)
        seen, distance, _ = self._interpolated(u, v)
        width, height = jnp.asarray(self.cameras.size).T
        # Images smaller than the largest one end before the grid of values does.
        seen &= (u < width[:, None] - 0.5) & (v < height[:, None] - 0.5)
        return seen, self._in_metres(seen, distance, depth)

    @property
    def empty_views(self) -> Bool[Array, " cams"]:
        """Views of one frame without information, because they show no person."""
        values = jnp.asarray(self.values)
        return (values if self.frame is None else values[self.frame])[:, 0] == _LOST

    def near(self, points: Float[Array, "points 3"]) -> Float[Array, "cams points"]:
        """As `at`, but without interpolation and without a gradient."""
        u, v, depth = self._seen(points)
        seen, x, y = self._cells(u, v)
        place = self._once(self._places(jnp.round(y).astype(jnp.int32), jnp.round(x).astype(jnp.int32)))
        return self._in_metres(seen, self._value(place), depth)

    def with_gradient(
        self, points: Float[Array, "points 3"]
    ) -> tuple[Float[Array, "cams points"], tuple[Float[Array, "cams points"], ...]]:
        """The result of `at`, and its gradient with respect to x, y and z."""
        right, low, depth = (jnp.asarray(a) for a in in_cameras(self.cameras, self._once(points)))
        u, v = on_images(self.cameras, right, low, depth)
        seen, distance, (along_u, along_v) = self._interpolated(u, v)
        x, y = (jnp.where(seen, a / depth, 0.0) for a in (right, low))
        u_by_x, u_by_y, v_by_x, v_by_y = lens_slopes(self.cameras, x, y)
        by_x, by_y = along_u * u_by_x + along_v * v_by_x, along_u * u_by_y + along_v * v_by_y
        # Gradient of distance (px) times depth, with respect to the point in camera coordinates.
        slopes = (by_x, by_y, distance - x * by_x - y * by_y)
        seems = apparent_depth(self.cameras, right, low, depth)
        if self.cameras.fisheye is not None:  # times the distance from the centre, which depends on all coordinates
            wide, farther = self.cameras.fisheye[:, None], jnp.where(seen, seems / depth, 1.0)
            slopes = (
                farther * by_x + jnp.where(wide, distance * x / farther, 0.0),
                farther * by_y + jnp.where(wide, distance * y / farther, 0.0),
                distance / farther - farther * (x * by_x + y * by_y),
            )
        slopes = jnp.where(seen[None], jnp.stack(slopes) / self._focal[None], 0.0)
        slopes, metres = self._once((slopes, self._in_metres(seen, distance, seems)))
        turned = jnp.asarray(self.cameras.R)
        gradient = tuple(
            sum((slopes[row] * turned[:, row, axis, None] for row in range(3)), jnp.zeros(())) for axis in range(3)
        )
        return metres, gradient

    def _seen(
        self, points: Float[Array, "points 3"]
    ) -> tuple[Float[Array, "cams points"], Float[Array, "cams points"], Float[Array, "cams points"]]:
        """Projections (px) of points in the world (m), and their depths (m), see `apparent_depth`."""
        right, low, depth = (jnp.asarray(a) for a in in_cameras(self.cameras, self._once(points)))
        u, v = on_images(self.cameras, right, low, depth)
        return u, v, apparent_depth(self.cameras, right, low, depth)

    @property
    def _focal(self) -> Float[Array, "cams 1"]:
        K = jnp.asarray(self.cameras.K)
        return (K[:, 0, 0] + K[:, 1, 1])[:, None] / 2

    def _in_metres(
        self,
        seen: Bool[Array, "cams points"],
        distance: Float[Array, "cams points"],
        depth: Float[Array, "cams points"],
    ) -> Float[Array, "cams points"]:
        """Convert distances (px) at the depths (m) of points to metres, as `at` returns them."""
        return jnp.where(seen, distance * depth / self._focal, _NOTHING)

    def _cells(
        self, u: Float[Array, "cams points"], v: Float[Array, "cams points"]
    ) -> tuple[Bool[Array, "cams points"], Float[Array, "cams points"], Float[Array, "cams points"]]:
        """Whether image points (px) are seen, and their coordinates in the grid, whose values are means over cells."""
        rows, columns = self._shape
        # Unseen points are NaN and would make the gradient by the step NaN; the step is never a variable.
        step = jax.lax.stop_gradient(self.step)
        x, y = ((a + 0.5) / step - 0.5 for a in (u, v))
        seen = (x > -0.5) & (y > -0.5) & (x < columns - 0.5) & (y < rows - 0.5)  # false for NaN
        x, y = jnp.where(seen, x, 0.0), jnp.where(seen, y, 0.0)
        return seen, jnp.clip(x, 0.0, columns - 1.001), jnp.clip(y, 0.0, rows - 1.001)

    @property
    def _shape(self) -> Int[Array, "2"]:
        return jnp.asarray(self.shape)

    def _places(self, row: Int[Array, "cams points"], column: Int[Array, "cams points"]) -> Int[Array, "cams points"]:
        """Flat indices into all values, of cells of each view."""
        view = jnp.arange(len(row), dtype=jnp.int32)[:, None]
        view = (view if self.frame is None else self.frame * len(row) + view) * self.values.shape[-1]
        return view + row * self._shape[1] + column

    def _value(self, place: Int[Array, "*corners cams points"]) -> Float[Array, "*corners cams points"]:
        """Distances (px) at flat indices."""
        return self._flat.at[place].get(mode="promise_in_bounds")

    def _once(self, results: T) -> T:
        return computed_once(results, self._flat[0])

    @property
    def _flat(self) -> Float[Array, " all"]:
        return jnp.asarray(self.values).reshape(-1)

    def _interpolated(
        self, u: Float[Array, "cams points"], v: Float[Array, "cams points"]
    ) -> tuple[Bool[Array, "cams points"], Float[Array, "cams points"], tuple[Float[Array, "cams points"], ...]]:
        """Whether image points (px) are seen, the interpolated distances (px), and their slopes along u and v."""
        seen, x, y = self._cells(u, v)
        column, row = jnp.floor(x).astype(jnp.int32), jnp.floor(y).astype(jnp.int32)
        # Joined, because XLA writes results over arrays of their own size, which is slow, see `OPTIONS`.
        place, (x, y), seen = self._once((self._places(row, column), jnp.stack([x - column, y - row]), seen))
        below = self._shape[1]
        a, b, c, d = self._value(place[None] + jnp.asarray([0, 1, below, below + 1])[:, None, None])
        upper, lower = a * (1 - x) + b * x, c * (1 - x) + d * x
        slope = ((b - a) * (1 - y) + (d - c) * y) / self.step, (lower - upper) / self.step
        return seen, upper * (1 - y) + lower * y, slope


def silhouette_distances(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    empty_views: Bool[np.ndarray, "frames cams"],
    misses: int = 0,
) -> SilhouetteDistances:
    """Distances to the silhouettes of some frames.

    Args:
        silhouettes: Packed bits.
        cameras: The rig.
        empty_views: Views that show no person; they give no information.
        misses: Number of views that may err, see `judge_misses`.
    """
    frames, views, height = silhouettes.shape[:3]
    width = 8 * silhouettes.shape[3]
    step = -(-max(height, width) // _MOST_CELLS)
    shape = -(-height // step), -(-width // step)
    values = aligned((frames, rig_size(views), _MOST_CELLS**2))
    # A camera that sees nothing is nevertheless looked up in the first cell and its neighbours.
    values[:, views:, : shape[1] + 2] = _LOST
    images = values[..., : shape[0] * shape[1]].reshape(*values.shape[:2], *shape)
    for frame, packed in enumerate(silhouettes):
        for view, box in enumerate(person_boxes(packed)):
            right, low = cameras.size[view].tolist()
            rows, columns = -(-low // step), -(-right // step)
            own = images[frame, view]
            if empty_views[frame, view]:
                own[:] = _LOST
                continue
            own[rows:], own[:rows, columns:] = _LOST, _LOST  # beyond an image that is smaller than others
            own[:rows, :columns] = _FARTHEST
            if box is not None:
                _write_distances(own[:rows, :columns], packed[view, :low], box, right, step, _FARTHEST)
    one = np.array(shape, np.int32), np.float32(step), with_blind_cameras(cameras), np.int32(misses)
    return SilhouetteDistances(values, *jax.tree.map(lambda a: np.broadcast_to(a, (frames, *np.shape(a))), one))


def signed_distances(
    packed: UInt8[np.ndarray, "h w8"], across: int, step: int, farthest: int = _FARTHEST, fine: bool = False
) -> Float[np.ndarray, "rows columns"]:
    """Signed distances to one silhouette (px), as means over square cells of its image; exact near the person.

    Args:
        packed: Packed bits of the silhouette.
        across: Width of the image (px).
        step: Width of a cell (px).
        farthest: Distances are clipped to this value (px).
        fine: Whether to locate outlines to a fraction of a pixel, which takes twice the time.
    """
    found = np.full((-(-len(packed) // step), -(-across // step)), farthest, np.float32)
    box = person_boxes(packed)[0]
    if box is not None:
        _write_distances(found, packed, box, across, step, farthest, fine)
    return found


def _write_distances(
    found: Float[np.ndarray, "rows columns"],
    packed: UInt8[np.ndarray, "h w8"],
    box: Box,
    across: int,
    step: int,
    farthest: int,
    fine: bool = False,
) -> None:
    """Write `signed_distances` into an array filled with `farthest`, most of which stays unchanged."""
    height, width = found.shape
    top, left = (max(first - farthest, 0) // step for first in (box.top, box.left))
    bottom, right = (min((end - 1 + farthest) // step + 1, n) for end, n in ((box.bottom, height), (box.right, width)))
    near = unpacked_box(packed, step * top, step * bottom, step * left, min(step * right, across)).view(np.uint8)
    # A person cut off by the edge of the image continues beyond it, also in an incomplete last cell.
    beyond = step * (bottom - top) - near.shape[0], step * (right - left) - near.shape[1]
    near = cv2.copyMakeBorder(near, 0, beyond[0], 0, beyond[1], cv2.BORDER_REPLICATE)
    pixel = 1.0
    if step > _PIXELS and not fine:
        pixel, size = step / _PIXELS, (_PIXELS * (right - left), _PIXELS * (bottom - top))
        near = cv2.threshold(cv2.resize(255 * near, size, interpolation=cv2.INTER_AREA), 127, 1, cv2.THRESH_BINARY)[1]
    away = 1 - near
    signed = cv2.distanceTransform(away, cv2.DIST_L2, 3)
    # The transform of the inside needs only the bounding box and one pixel around it.
    left_most, top_most, wide, high = cv2.boundingRect(near)
    own = slice(max(top_most - 1, 0), top_most + high + 1), slice(max(left_most - 1, 0), left_most + wide + 1)
    signed[own] -= cv2.distanceTransform(np.ascontiguousarray(near[own]), cv2.DIST_L2, 3)
    # The distance is zero half-way between person and background pixels.
    signed = cv2.addWeighted(signed, pixel, away, -pixel, 0.5 * pixel, dtype=cv2.CV_32F)
    cv2.threshold(signed, farthest, 0, cv2.THRESH_TRUNC, dst=signed)
    if fine:
        signed = _without_stairs(near, signed)
    found[top:bottom, left:right] = cv2.resize(signed, (right - left, bottom - top), interpolation=cv2.INTER_AREA)


def _without_stairs(person: UInt8[np.ndarray, "h w"], signed: Float[np.ndarray, "h w"]) -> Float[np.ndarray, "h w"]:
    """Refine distances (px) near the outline by the share of person pixels in the neighbourhood.

    Areas locate the outline of a binary image to a fifth of a pixel; the nearest pixel centre does not.
    """
    outside = (1 - person).astype(np.float32)
    mean = cv2.GaussianBlur(outside, (0, 0), _SMOOTHING, borderType=cv2.BORDER_REPLICATE)
    # Twicing: a kernel without second moments. A Gaussian alone would shrink round shapes, fingers most of all.
    mean += cv2.GaussianBlur(outside - mean, (0, 0), _SMOOTHING, borderType=cv2.BORDER_REPLICATE)
    slope = (2 - np.sqrt(0.5)) / (_SMOOTHING * np.sqrt(2 * np.pi))  # of the mean, across a straight outline
    near = 1 - np.clip((np.abs(signed) - _NEAR) / _NEAR, 0, 1)
    return (near * (mean - 0.5) / slope + (1 - near) * signed).astype(np.float32)
