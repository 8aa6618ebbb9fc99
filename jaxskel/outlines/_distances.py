"""Signed distances to the silhouettes, view by view: where a body may be, as every single view sees it.

A hull lets the poorest of its views decide: one hole in one mask is a tunnel through the person. Here each view speaks
for itself, and a term can be robust to those that err.
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
from ..cameras import Cameras, apparent_depth, in_cameras, lens_slopes, on_images
from ..recording import Box, person_boxes, unpacked_box

T = TypeVar("T")

# Values stand this many to a side of the image at most: finer ones say the same.
_MOST_CELLS = 320
# Distances (px) are exact so far from the silhouette, and never larger.
_FARTHEST = 40
# Of the Gaussian that means over neighbourhoods are made with (px), and how far from the outline these tell more than
# the distance does (px): no farther than twice that.
_SMOOTHING, _NEAR = 0.7, 1.5
# What a view tells that tells nothing (m): well inside.
_NOTHING = -1.0
# All values of a lost view (px): far inside, wherever one looks.
_LOST = -1e3


class SilhouetteDistances(eqx.Module):
    """Signed distance from the outline of each silhouette on a regular grid of its image: negative on the person."""

    values: Float[Array | np.ndarray, "*stack cams rows columns"]
    """Distances (px), with the leading axes of the others, or, see `frame`, those of a stack."""
    step: Float[Array | np.ndarray, "*frames"]
    """Distance of neighbouring values (px)."""
    cameras: Cameras
    """The rig, in the world worked in, with the same leading axes."""
    misses: Int[Array | np.ndarray, "*frames"]
    """So many views may err at any point."""
    frame: Int[Array, ""] | None = None
    """Where this is one frame of a stack, which one: then `values` are still those of all frames."""

    def of(self, frame: Int[Array, ""]) -> "SilhouetteDistances":
        """One frame of a stack on the device; its values, which are large, stay where they are."""
        step, cameras, misses = jax.tree.map(lambda a: a[frame], (self.step, self.cameras, self.misses))
        return SilhouetteDistances(self.values, step, cameras, misses, frame)

    def at(self, points: Float[Array, "points 3"]) -> Float[Array, "cams points"]:
        """Distances at points of the world (m, at the depth of each point, see `apparent_depth`), for one frame.

        Far inside (-1 m) where a view tells nothing: outside of its image, behind it, or where it has lost the person.
        """
        u, v, depth = self._seen(points)
        seen, distance, _ = self._interpolated(u, v)
        return self._in_metres(seen, distance, depth)

    def seen_at(
        self, points: Float[Array, "points 3"]
    ) -> tuple[Bool[Array, "cams points"], Float[Array, "cams points"]]:
        """Whether points of the world (m) fall into each image, and the distances there as `at` gives them."""
        u, v, depth = self._seen(points)
        seen, distance, _ = self._interpolated(u, v)
        width, height = jnp.asarray(self.cameras.size).T
        # Images that are smaller than the largest one end before the values do.
        seen &= (u < width[:, None] - 0.5) & (v < height[:, None] - 0.5)
        return seen, self._in_metres(seen, distance, depth)

    @property
    def empty_views(self) -> Bool[Array, " cams"]:
        """Views of one frame that tell nothing, because they show no person."""
        values = jnp.asarray(self.values)
        return (values if self.frame is None else values[self.frame])[:, 0, 0] == _LOST

    def near(self, points: Float[Array, "points 3"]) -> Float[Array, "cams points"]:
        """The same without interpolation and without a gradient."""
        u, v, depth = self._seen(points)
        seen, x, y = self._cells(u, v)
        place = self._once(self._places(jnp.round(y).astype(jnp.int32), jnp.round(x).astype(jnp.int32)))
        distance = self._value(place)
        return self._in_metres(seen, distance, depth)

    def with_gradient(
        self, points: Float[Array, "points 3"]
    ) -> tuple[Float[Array, "cams points"], tuple[Float[Array, "cams points"], ...]]:
        """What `at` gives, and its gradient by x, y and z."""
        right, low, depth = (jnp.asarray(a) for a in in_cameras(self.cameras, self._once(points)))
        u, v = on_images(self.cameras, right, low, depth)
        seen, distance, (along_u, along_v) = self._interpolated(u, v)
        x, y = (jnp.where(seen, a / depth, 0.0) for a in (right, low))
        u_by_x, u_by_y, v_by_x, v_by_y = lens_slopes(self.cameras, x, y)
        by_x, by_y = along_u * u_by_x + along_v * v_by_x, along_u * u_by_y + along_v * v_by_y
        # Of the distance in pixels times the depth, by a point in the frame of each camera.
        slopes = (by_x, by_y, distance - x * by_x - y * by_y)
        seems = apparent_depth(self.cameras, right, low, depth)
        if self.cameras.fisheye is not None:  # times the distance, which moves in all directions
            wide, farther = self.cameras.fisheye[:, None], jnp.where(seen, seems / depth, 1.0)
            slopes = (
                farther * by_x + jnp.where(wide, distance * x / farther, 0.0),
                farther * by_y + jnp.where(wide, distance * y / farther, 0.0),
                distance / farther - farther * (x * by_x + y * by_y),
            )
        slopes = tuple(jnp.where(seen, slope / self._focal, 0.0) for slope in slopes)
        turned = jnp.asarray(self.cameras.R)
        gradient = tuple(
            sum((slopes[row] * turned[:, row, axis, None] for row in range(3)), jnp.zeros(())) for axis in range(3)
        )
        return self._once((self._in_metres(seen, distance, seems), gradient))

    def _seen(
        self, points: Float[Array, "points 3"]
    ) -> tuple[Float[Array, "cams points"], Float[Array, "cams points"], Float[Array, "cams points"]]:
        """Where points of the world (m) are seen (px), and at what depth, see `apparent_depth` (m)."""
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
        """Distances (px) at the depths (m) of what is seen, as `at` gives them."""
        return jnp.where(seen, distance * depth / self._focal, _NOTHING)

    def _cells(
        self, u: Float[Array, "cams points"], v: Float[Array, "cams points"]
    ) -> tuple[Bool[Array, "cams points"], Float[Array, "cams points"], Float[Array, "cams points"]]:
        """Whether image points (px) are seen, and where they are in the grid, whose values are cells' means."""
        rows, columns = self.values.shape[-2:]
        # What is not seen is NaN, and would be the whole gradient by the step, which is no one's variable.
        step = jax.lax.stop_gradient(self.step)
        x, y = ((a + 0.5) / step - 0.5 for a in (u, v))
        seen = (x > -0.5) & (y > -0.5) & (x < columns - 0.5) & (y < rows - 0.5)  # false for NaN
        x, y = jnp.where(seen, x, 0.0), jnp.where(seen, y, 0.0)
        return seen, jnp.clip(x, 0.0, columns - 1.001), jnp.clip(y, 0.0, rows - 1.001)

    def _places(self, row: Int[Array, "cams points"], column: Int[Array, "cams points"]) -> Int[Array, "cams points"]:
        """Of cells of each view, as indices into all values."""
        rows, columns = self.values.shape[-2:]
        view = jnp.arange(len(row), dtype=jnp.int32)[:, None]
        view = (view if self.frame is None else self.frame * len(row) + view) * (rows * columns)
        return view + row * columns + column

    def _value(self, place: Int[Array, "cams points"]) -> Float[Array, "cams points"]:
        """Of cells (px)."""
        return self._flat.at[place].get(mode="promise_in_bounds")

    def _once(self, results: T) -> T:
        return computed_once(results, self._flat[0])

    @property
    def _flat(self) -> Float[Array, " all"]:
        return jnp.asarray(self.values).reshape(-1)

    def _interpolated(
        self, u: Float[Array, "cams points"], v: Float[Array, "cams points"]
    ) -> tuple[Bool[Array, "cams points"], Float[Array, "cams points"], tuple[Float[Array, "cams points"], ...]]:
        """Whether image points (px) are seen, the distances there (px), and their slopes along u and v."""
        seen, x, y = self._cells(u, v)
        column, row = jnp.floor(x).astype(jnp.int32), jnp.floor(y).astype(jnp.int32)
        place, x, y, seen = self._once((self._places(row, column), x - column, y - row, seen))
        below = self.values.shape[-1]
        a, b, c, d = (self._value(place + away) for away in (0, 1, below, below + 1))
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
        empty_views: Views that show no person; they tell nothing.
        misses: How many views may err, see `judge_misses`.
    """
    frames, views, height = silhouettes.shape[:3]
    width = 8 * silhouettes.shape[3]
    step = -(-max(height, width) // _MOST_CELLS)
    shape = (frames, views, -(-height // step), -(-width // step))
    values = aligned(shape)
    for frame, packed in enumerate(silhouettes):
        for view, box in enumerate(person_boxes(packed)):
            right, low = cameras.size[view].tolist()
            rows, columns = -(-low // step), -(-right // step)
            own = values[frame, view]
            own[:] = _LOST  # also beyond an image that is smaller than others
            if empty_views[frame, view]:
                continue
            own[:rows, :columns] = _FARTHEST
            if box is not None:
                _write_distances(own[:rows, :columns], packed[view, :low], box, right, step, _FARTHEST)
    stacked = jax.tree.map(lambda a: np.broadcast_to(a, (frames, *a.shape)), cameras)
    return SilhouetteDistances(values, np.full(frames, step, np.float32), stacked, np.full(frames, misses, np.int32))


def signed_distances(
    packed: UInt8[np.ndarray, "h w8"], across: int, step: int, farthest: int = _FARTHEST, fine: bool = False
) -> Float[np.ndarray, "rows columns"]:
    """Means over cells of an image so many pixels wide (px), exact near the person.

    Args:
        packed: A silhouette.
        across: Width of the image.
        step: Width of a cell.
        farthest: No distance is larger.
        fine: Outlines run between the pixels without their stairs, which takes twice the time.
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
    """`signed_distances` into an array that holds `farthest` everywhere: most of it stays as it is."""
    height, width = found.shape
    top, left = (max(first - farthest, 0) // step for first in (box.top, box.left))
    bottom, right = (min((end - 1 + farthest) // step + 1, n) for end, n in ((box.bottom, height), (box.right, width)))
    near = unpacked_box(packed, step * top, step * bottom, step * left, min(step * right, across)).view(np.uint8)
    # A person who is cut off by the edge of the image goes on there, also where the last cell is not whole.
    beyond = step * (bottom - top) - near.shape[0], step * (right - left) - near.shape[1]
    near = cv2.copyMakeBorder(near, 0, beyond[0], 0, beyond[1], cv2.BORDER_REPLICATE)
    away = 1 - near
    signed = cv2.distanceTransform(away, cv2.DIST_L2, 3)
    # Inside, nothing counts that is farther out than the next pixel.
    left_most, top_most, wide, high = cv2.boundingRect(near)
    own = slice(max(top_most - 1, 0), top_most + high + 1), slice(max(left_most - 1, 0), left_most + wide + 1)
    signed[own] -= cv2.distanceTransform(np.ascontiguousarray(near[own]), cv2.DIST_L2, 3)
    # Half-way between two pixels the distance is zero.
    signed = cv2.addWeighted(signed, 1, away, -1, 0.5, dtype=cv2.CV_32F)
    cv2.threshold(signed, farthest, 0, cv2.THRESH_TRUNC, dst=signed)
    if fine:
        signed = _without_stairs(near, signed)
    size = (right - left, bottom - top)
    found[top:bottom, left:right] = cv2.resize(signed, size, interpolation=cv2.INTER_AREA)


def _without_stairs(person: UInt8[np.ndarray, "h w"], signed: Float[np.ndarray, "h w"]) -> Float[np.ndarray, "h w"]:
    """Distances (px) that are told near the outline by how much of the neighbourhood is person.

    Areas say where the outline of a binary image is to a fifth of a pixel; the nearest centre of a pixel does not.
    """
    outside = (1 - person).astype(np.float32)
    mean = cv2.GaussianBlur(outside, (0, 0), _SMOOTHING, borderType=cv2.BORDER_REPLICATE)
    # Twicing: a kernel without second moments. A Gaussian alone would shrink whatever is round, fingers most of all.
    mean += cv2.GaussianBlur(outside - mean, (0, 0), _SMOOTHING, borderType=cv2.BORDER_REPLICATE)
    slope = (2 - np.sqrt(0.5)) / (_SMOOTHING * np.sqrt(2 * np.pi))  # of it, across a straight outline
    near = 1 - np.clip((np.abs(signed) - _NEAR) / _NEAR, 0, 1)
    return (near * (mean - 0.5) / slope + (1 - near) * signed).astype(np.float32)
