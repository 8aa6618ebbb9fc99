"""Silhouettes and cameras at a reduced size, and the projections of points around the person into them."""

from typing import NamedTuple

import cv2
import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from ..cameras import Cameras, project
from ..hull import body_middles
from ..recording import find_empty_views, pack_silhouettes, person_boxes, silhouette_areas, unpack_view

# Points along an edge of the cube around the person. 64 give the same misfits on the real recordings, to a tenth.
POINTS = 48
# The cube extends this far from the middle, in half heights of the person, so that it contains an outstretched arm.
_REACH = 1.5
# Silhouettes are reduced until no side is longer (px): a person is then still about a hundred pixels tall.
_LONGEST_SIDE = 320


class ReducedViews(NamedTuple):
    """Some frames of a recording, small enough to be evaluated often.

    Attributes:
        cameras: With intrinsics for the reduced images.
        masks: True where most of a reduced pixel is person; all False if a view shows nobody.
        steps: Side length in image pixels of one reduced pixel.
    """

    cameras: Cameras
    masks: Bool[np.ndarray, "frames cams rows columns"]
    steps: Int[np.ndarray, " cams"]


class Samples(NamedTuple):
    """A cube of points around the person of each frame.

    Attributes:
        middle: Middle of the person in world coordinates (m).
        half: Half height: half of the person's largest extent in the images, at the middle's depth (m); NaN if not
            seen.
        points: Offsets from the middle, in half heights; the last axis varies fastest, equally many along each.
    """

    middle: Float[np.ndarray, "frames 3"]
    half: Float[np.ndarray, " frames"]
    points: Float[np.ndarray, "points 3"]

    @property
    def spacing(self) -> Float[np.ndarray, " frames"]:
        """Distance of neighbouring points (m)."""
        return 2 * _REACH / round(len(self.points) ** (1 / 3)) * self.half


class Sight(eqx.Module):
    """Where one camera sees the sample points.

    Attributes:
        pixel: Flat index (row times columns plus column) into the reduced image; -1 if the camera does not see the
            point.
        breadth: Width of a reduced pixel at the point's depth, in half heights of the person.
        side: Side of the square cells (reduced px) that leave no gap between neighbouring points.
    """

    pixel: Int[np.ndarray, "frames points"]
    breadth: Float[np.ndarray, "frames points"]
    side: Int[np.ndarray, " frames"]


def reduce_views(cameras: Cameras, silhouettes: UInt8[np.ndarray, "frames cams h w8"]) -> ReducedViews:
    """Reduce silhouettes and cameras by the same factors."""
    steps, sizes = _steps_and_sizes(cameras)
    columns, rows = sizes.max(0)
    masks = np.zeros((*silhouettes.shape[:2], rows, columns), bool)
    empty_views = find_empty_views(silhouette_areas(silhouettes), cameras)
    for c in range(len(cameras)):
        there = ~empty_views[:, c]
        masks[there, c] = reduced_silhouettes(cameras, c, silhouettes[there, c])
    return ReducedViews(cameras.reduced(steps), masks, steps)


def reduced_silhouettes(
    cameras: Cameras, index: int, silhouettes: UInt8[np.ndarray, "frames h w8"]
) -> Bool[np.ndarray, "frames rows columns"]:
    """Silhouettes of one camera, reduced as `reduce_views` does and padded to the largest reduced image."""
    steps, sizes = _steps_and_sizes(cameras)
    (width, height), (across, down), step = cameras.size[index].tolist(), sizes[index].tolist(), int(steps[index])
    found = np.zeros((len(silhouettes), *sizes.max(0)[::-1]), bool)
    padded = np.zeros((down * step, across * step), np.uint8)
    for f, packed in enumerate(silhouettes):
        padded[:height, :width] = 255 * unpack_view(packed, cameras.size[index])
        found[f, :down, :across] = cv2.resize(padded, (across, down), interpolation=cv2.INTER_AREA) > 127
    return found


def _steps_and_sizes(cameras: Cameras) -> tuple[Int[np.ndarray, " cams"], Int[np.ndarray, "cams 2"]]:
    steps = np.maximum(1, -(-cameras.size.max(1) // _LONGEST_SIDE))
    return steps, -(-cameras.size // steps[:, None])


def samples_around(
    cameras: Cameras, masks: Bool[np.ndarray, "frames cams rows columns"], points: int = POINTS
) -> Samples:
    """A cube of points around each person, sized by the silhouettes and so independent of the calibration's unit.

    There are `points` along each edge.
    """
    packed = pack_silhouettes(masks)
    there = np.asarray(masks.any((2, 3)))
    middle = body_middles(cameras, packed, ~there)
    boxes = person_boxes(packed)
    half = np.full(len(masks), np.nan)
    depth = np.einsum("cj,fj->fc", np.asarray(cameras.R)[:, 2], middle) + np.asarray(cameras.t)[:, 2]
    focal = np.asarray(cameras.K)[:, 0, 0]
    for f in range(len(masks)):
        found = []
        for c in np.flatnonzero(there[f] & (depth[f] > 0)):
            box = boxes[f * len(cameras) + c]
            if box is not None:
                found.append(0.5 * max(box.bottom - box.top, box.right - box.left) / focal[c] * depth[f, c])
        if found:
            half[f] = np.median(found)
    axis = _REACH * ((np.arange(points) + 0.5) / points * 2 - 1)
    return Samples(middle, half, np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3))


def sights_of(
    cameras: Cameras,
    columns: int,
    samples: Samples,
    hidden: Bool[np.ndarray, "frames cams rows columns"] | None = None,
) -> list[Sight]:
    """Where each camera sees the points, in images stored with the given number of columns.

    It does not see points behind pixels that are `hidden`, where others may stand before the person.
    """
    shape = len(samples.half), len(samples.points)
    found = [
        Sight(np.full(shape, -1, np.int32), np.zeros(shape, np.float32), np.ones(shape[0], int)) for _ in cameras.names
    ]
    focal = np.asarray(cameras.K)[:, 0, 0]
    for f in np.flatnonzero(np.isfinite(samples.half)):
        seen_at = project(cameras, samples.middle[f] + samples.half[f] * samples.points)
        u, v, depth = (np.asarray(each) for each in seen_at)
        for c, sight in enumerate(found):
            width, height = cameras.size[c]
            # Computed for all points: picking out those inside takes longer.
            with np.errstate(invalid="ignore"):
                inside = (u[c] >= -0.5) & (v[c] >= -0.5) & (u[c] < width - 0.5) & (v[c] < height - 0.5)
                pixel = (v[c] + 0.5).astype(np.int32) * columns + (u[c] + 0.5).astype(np.int32)
            if not inside.any():
                continue
            breadth = depth[c] / focal[c]
            sight.breadth[f] = np.where(inside, breadth / samples.half[f], 0)
            # Neighbouring points are farthest apart along the diagonals of their cubes.
            sight.side[f] = max(1, np.ceil(np.sqrt(3) * samples.spacing[f] / np.median(breadth[inside])))
            if hidden is not None:
                inside[inside] = ~hidden[f, c].reshape(-1).take(pixel[inside])
            sight.pixel[f] = np.where(inside, pixel, -1)
    return found
