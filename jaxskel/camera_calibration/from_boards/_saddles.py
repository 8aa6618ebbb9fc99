"""Refines checkerboard corners to a fiftieth of a pixel: saddle points of the image in board coordinates."""

import cv2
import numpy as np
from jaxtyping import Float, UInt8

# Reach of the window, as a share of the way to the next corners: almost to the edges of the four squares, however flat
# they appear.
_REACH = 0.4
_SAMPLES = 9  # sample points along each side of the window
_ROUNDS = 5  # of refinement; the last one moves a corner by less than a thousandth of a square
# Power of the levels that counters bloom of white paper over black squares. Bloom keeps the image symmetric under a
# half turn about a corner, so its saddle stays; the power keeps it in the middle of the range.
_POWER = 4.0
_STRAYED = 0.3  # squares: farther than any detector errs, so a corner that moves this far was none


def refine_saddles(
    lattice: Float[np.ndarray, "rows columns 2"], grey: UInt8[np.ndarray, "h w"]
) -> Float[np.ndarray, "rows columns 2"]:
    """Move corners (px) to the saddle points of quadratics fitted around them.

    The windows have the shape of the squares in the image. The upright windows of `cv2.cornerSubPix` reach into the
    next squares if a board is seen at a grazing angle, and its gradients move where white blooms.
    """
    levels = (grey.astype(np.float32) / 255) ** _POWER
    moved, found = _to_saddles(lattice, levels)
    if found.all():
        return moved
    # The detector took something else for a corner, such as the rim: try again from the place that the others predict.
    start = np.where(found[..., None], moved, _smooth(moved, found))
    moved, found = _to_saddles(start, levels)
    return np.where(found[..., None], moved, start)


def _to_saddles(lattice: np.ndarray, levels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lattice with its corners moved to saddle points, and which corners have one nearby."""
    side = np.linspace(-_REACH, _REACH, _SAMPLES)
    a, b = (axis.ravel() for axis in np.meshgrid(side, side))
    fit = np.linalg.pinv(np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], -1))
    moved, total = lattice, np.zeros_like(lattice)
    for _ in range(_ROUNDS):
        down, along = np.gradient(moved, axis=(0, 1))
        windows = moved[:, :, None] + a[:, None] * along[:, :, None] + b[:, None] * down[:, :, None]
        flat = windows.reshape(-1, a.size, 2).astype(np.float32)
        seen = cv2.remap(levels, flat[..., 0], flat[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        _, ga, gb, aa, ab, bb = fit @ np.asarray(seen, np.float64).T
        bend = 4 * aa * bb - ab * ab
        saddle = bend < 0
        bend = np.where(saddle, bend, -1.0)
        step = np.stack([(ab * gb - 2 * bb * ga) / bend, (ab * ga - 2 * aa * gb) / bend], -1)
        step = np.clip(np.where(saddle[:, None], step, _STRAYED), -_STRAYED, _STRAYED).reshape(lattice.shape)
        moved = moved + step[..., :1] * along + step[..., 1:] * down
        total = total + step
    return moved, np.abs(total).max(-1) < _STRAYED


def _smooth(lattice: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Fit cubics in board coordinates to the known corners; perspective and lens bend the lattice no further."""
    i, j = (index / size - 0.5 for index, size in zip(np.indices(known.shape), known.shape, strict=True))
    powers = np.stack([i**p * j**q for p in range(4) for q in range(4 - p)], -1)
    return powers @ np.linalg.lstsq(powers[known], lattice[known], rcond=None)[0]
