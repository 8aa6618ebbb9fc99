"""Silhouettes widened by some pixels, in reduced images: coarse voxels then miss no thin limb between their centres."""

import cv2
import numpy as np
from jaxtyping import Bool, Int, UInt8

from ..cameras import Cameras
from ..recording import pack_silhouettes, unpack_view

_BYTE = 8  # pixels that are packed into one byte
# From this many pixels on, images are reduced: that is faster, but widens by up to twice as much as was asked for.
_MANY = 4


def steps_for(pixels: Int[np.ndarray, " cams"]) -> Int[np.ndarray, " cams"]:
    """Side length (px) of one reduced pixel of each view whose silhouettes are widened by so many pixels."""
    return np.where(pixels < _MANY, 1, _BYTE * -(-pixels // _BYTE))


def widened(
    cameras: Cameras, silhouettes: UInt8[np.ndarray, "frames cams h w8"], pixels: Int[np.ndarray, " cams"]
) -> UInt8[np.ndarray, "frames cams rows columns8"]:
    """Silhouettes widened on all sides by at least some pixels, for ``cameras.reduced(steps_for(pixels))``.

    Args:
        cameras: The rig.
        silhouettes: Packed bits.
        pixels: Least number of pixels, for each view.
    """
    steps = steps_for(pixels)
    sizes = cameras.reduced(steps).size
    found = np.zeros((*silhouettes.shape[:2], *sizes.max(0)[::-1]), bool)
    for c, (step, least, (columns, rows)) in enumerate(
        zip(steps.tolist(), pixels.tolist(), sizes.tolist(), strict=True)
    ):
        if step == 1:
            masks, radius = unpack_view(silhouettes[:, c], cameras.size[c]), least
        else:
            masks, radius = _reduced(silhouettes[:, c], step, rows, columns), 1
        square = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
        for f, mask in enumerate(masks):
            found[f, c, :rows, :columns] = cv2.dilate(mask.astype(np.uint8), square)
    return pack_silhouettes(found)


def _reduced(
    silhouettes: UInt8[np.ndarray, "frames h w8"], step: int, rows: int, columns: int
) -> Bool[np.ndarray, "frames rows columns"]:
    """Whether any pixel of each square of `step` pixels, whole bytes, is person."""
    count, height, width = silhouettes.shape
    high, wide = rows * step, columns * step // _BYTE
    padded = np.pad(silhouettes, ((0, 0), (0, max(0, high - height)), (0, max(0, wide - width))))[:, :high, :wide]
    across = padded.reshape(count, high, columns, -1).any(-1)
    return np.asarray(across.reshape(count, rows, step, columns).any(2))
