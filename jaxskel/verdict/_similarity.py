"""Fits how far a view's images are shifted, resized and rolled relative to the other views."""

import numpy as np
from jaxtyping import Bool, Float

from ._repairs import Similarity
from ._scene import Scene

# First steps of the search: scale, right and down (px), roll (rad). Each is halved three times.
_STEPS = (0.04, 8.0, 8.0, 0.07)
_HALVINGS = 3
# The search ends once this share of the contradiction remains: a finding needs no subpixel accuracy.
_ENOUGH = 0.01
# Number of frames that are used.
_FRAMES = 4


def fit_similarity(scene: Scene, view: int, without: float) -> Similarity:
    """The similarity transform that makes a view agree best with the others.

    The search starts from the boxes around the silhouettes and around the hull of the other views, and goes on by
    coordinate steps.

    Args:
        scene: Scene with the contradiction.
        view: Index of the view.
        without: Misfit of the other views alone (half heights).
    """
    scene = scene.at(np.unique(np.linspace(0, len(scene.masks) - 1, _FRAMES).round().astype(int)))
    masks = scene.masks[:, view]
    before = scene.misfit()
    enough = without + _ENOUGH * (before - without)

    def left(values: tuple[float, ...]) -> float:
        mended = Similarity(*values).apply(masks)
        if (mended.sum((1, 2)) < 0.3 * masks.sum((1, 2)) / values[0] ** 2).any():
            return np.inf  # moved out of the image
        return scene.with_masks(view, mended).misfit()

    scale, right, down = _first_guess(scene, view)
    best = min((left(values), values) for values in ((1.0, right[0], down[0], 0.0), (scale, right[1], down[1], 0.0)))
    for halving in range(_HALVINGS + 1):
        steps = np.array(_STEPS) / 2**halving
        improved = True
        while improved and best[0] > enough:
            improved = False
            for axis, sign in ((a, s) for a in range(4) for s in (1, -1)):
                values = np.array(best[1])
                values[axis] += sign * steps[axis]
                tried = left(tuple(values.tolist())), tuple(values.tolist())
                if tried[0] < best[0] - 1e-6:
                    best, improved = tried, True
    return Similarity(*best[1])


def _first_guess(scene: Scene, view: int) -> tuple[float, tuple[float, float], tuple[float, float]]:
    """Scale, and the shifts right and down (px), each without and with that scale."""
    rows, columns = scene.masks.shape[2:]
    actual, expected = [], []
    for f, frame in enumerate(scene.frames):
        mask = scene.masks[f, view]
        rest = scene.without(view)
        inside = frame.near[(frame.distance[rest] <= 0).all(0)]
        pixel = scene.sights[view].pixel[f, inside]
        pixel = pixel[pixel >= 0]
        if mask.any() and len(pixel):
            hull = np.zeros((rows, columns), bool)
            hull.flat[pixel] = True
            actual.append(_box(mask))
            expected.append(_box(hull))
    if not actual:
        return 1.0, (0.0, 0.0), (0.0, 0.0)
    a, b = (np.array(boxes) for boxes in (actual, expected))
    size = [(each[:, 2] - each[:, 0]) + (each[:, 3] - each[:, 1]) for each in (a, b)]
    scale = float(np.clip(np.median(size[0] / np.maximum(size[1], 1)), 0.2, 5.0))
    middle = np.array([columns - 1, rows - 1]) / 2
    centre = [(each[:, :2] + each[:, 2:]) / 2 for each in (a, b)]
    plain = np.median(centre[0] - centre[1], axis=0)
    scaled = np.median(centre[0] - (middle + scale * (centre[1] - middle)), axis=0)
    return scale, (float(plain[0]), float(scaled[0])), (float(plain[1]), float(scaled[1]))


def _box(mask: Bool[np.ndarray, "rows columns"]) -> Float[np.ndarray, "4"]:
    """Left, top, right and bottom of a silhouette (px), without the outermost 2 % of pixels: specks do not count."""
    row, column = np.nonzero(mask)
    left, right = np.percentile(column, (2, 98))
    top, bottom = np.percentile(row, (2, 98))
    return np.array([left, top, right, bottom])
