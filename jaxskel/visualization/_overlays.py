"""Draws silhouette, voxel box, hull and skeleton over the views, and tiles images."""

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from .._runtime.picture_files import write_image as write_image
from ..body import HUMAN_15, SkeletonTemplate
from ..cameras import Cameras, project
from ..hull import VoxelGrid
from ._skeleton_style import colours_of, drawn_joint_bones

Image = UInt8[np.ndarray, "h w 3"]

# Colours in OpenCV's order: blue, green, red.
BACKGROUND, PERSON, HULL, BOX = (40, 36, 34), (200, 200, 200), (80, 200, 250), (200, 140, 230)


def draw_silhouette(mask: Bool[np.ndarray, "h w"]) -> Image:
    """The silhouette in light grey on dark."""
    return np.where(mask[..., None], np.array(PERSON, np.uint8), np.array(BACKGROUND, np.uint8))


def draw_hull(image: Image, hull: Bool[np.ndarray, "h w"]) -> None:
    """Tint the pixels that the hull covers."""
    image[hull] = (0.6 * image[hull] + 0.4 * np.array(HULL)).astype(np.uint8)


def draw_skeleton(
    image: Image,
    cameras: Cameras,
    view: int,
    joints: Float[np.ndarray, "joints 3"],
    template: SkeletonTemplate = HUMAN_15,
) -> None:
    """Draw the bones of a pose of a template (world, m); a pose of NaN leaves the image unchanged."""
    if not np.isfinite(joints).all():
        return
    u, v, _ = (np.asarray(a[0]) for a in project(cameras[[view]], np.asarray(joints, np.float64)))
    thickness = max(1, image.shape[0] // 160)
    colours = colours_of(template).tolist()
    for joint, parent in drawn_joint_bones(template).tolist():
        if np.isfinite([u[joint], v[joint], u[parent], v[parent]]).all():
            red, green, blue = colours[joint]
            _line(image, (u[joint], v[joint]), (u[parent], v[parent]), (blue, green, red), thickness)
    for joint in range(len(joints)):
        if np.isfinite([u[joint], v[joint]]).all():
            cv2.circle(image, (round(u[joint]), round(v[joint])), thickness + 1, (255, 255, 255), -1, cv2.LINE_AA)


def draw_box(image: Image, cameras: Cameras, view: int, grid: VoxelGrid) -> None:
    """Draw the edges of the voxel grid (world, m)."""
    low, high = np.asarray(grid.origin), grid.upper
    corners = np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i, j, k in np.ndindex(2, 2, 2)])
    for a in range(8):
        for b in range(a + 1, 8):
            if (a ^ b) in (1, 2, 4):
                # In steps, because lens distortion bends lines and an edge may run behind the camera.
                along = np.linspace(0, 1, 33)[:, None]
                u, v, _ = project(cameras[[view]], corners[a] + along * (corners[b] - corners[a]))
                ends = np.stack([u[0], v[0]], -1)
                for start, end in zip(ends[:-1], ends[1:], strict=True):
                    if np.isfinite([start, end]).all():
                        _line(image, start, end, BOX, max(1, image.shape[0] // 400))


def tile(images: Sequence[Image], labels: Sequence[str], columns: int, width: int = 360) -> Image:
    """Put images of any sizes side by side, each with its label."""
    tiles = []
    height = max(round(width * image.shape[0] / image.shape[1]) for image in images)
    for image, label in zip(images, labels, strict=True):
        scale = width / image.shape[1]
        small = cv2.resize(image, (width, round(scale * image.shape[0])), interpolation=cv2.INTER_AREA)
        small = np.pad(small, ((0, height - len(small)), (0, 0), (0, 0)))
        cv2.putText(small, label, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1, cv2.LINE_AA)
        tiles.append(small)
    while len(tiles) % columns:
        tiles.append(np.zeros_like(tiles[0]))
    rows = [np.concatenate(tiles[i : i + columns], 1) for i in range(0, len(tiles), columns)]
    return np.concatenate(rows)


def _line(image: Image, start, end, colour: tuple[int, int, int], thickness: int) -> None:
    # OpenCV takes 32-bit integers, which a point far outside the image would overflow.
    limit = 4 * max(image.shape)
    a, b = (tuple(int(np.clip(round(float(x)), -limit, limit)) for x in point) for point in (start, end))
    cv2.line(image, a, b, colour, thickness, cv2.LINE_AA)
