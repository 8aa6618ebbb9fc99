"""Silhouettes and projected skeletons of all views, for as many frames as fit on a page."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, Int16

from ...cameras import Cameras, project
from ...recording import Recording, unpack_view
from ._outlines import UNSEEN, display_scale, outlines, to_units
from ._packed import packed_size


@dataclass(frozen=True)
class Overlays:
    """The content of the views in every ``stride``-th frame, starting with the first.

    Attributes:
        counts: Number of outlines in each view.
        lengths: Number of points of each outline, ordered by frame, then by view.
        points: Points of the outlines, in display units.
        skeletons: Projected joints and tips of each person, in display units; `UNSEEN` if missing.
    """

    stride: int
    counts: Int[np.ndarray, "shown cams"]
    lengths: Int[np.ndarray, " outlines"]
    points: Int16[np.ndarray, "n 2"]
    skeletons: Int16[np.ndarray, "people shown cams points 2"]

    def __len__(self) -> int:
        return len(self.counts)


def make_overlays(
    recording: Recording,
    rows: Int[np.ndarray, " frames"],
    bodies: Float[np.ndarray, "people frames points 3"],
    room: int,
    on_frame: Callable[[int], None] | None = None,
) -> Overlays:
    """Draw frames into all views; whenever they exceed the room, drop every second frame.

    So silhouettes are read once, one frame at a time.

    Args:
        recording: Silhouettes and cameras.
        rows: Frame of the recording for each frame of the page.
        bodies: Joints and tips of each person in the world (m), NaN without a pose.
        room: Largest size of the overlays in the page (bytes).
        on_frame: Called with the number of frames done.
    """
    views, points = len(recording.cameras), bodies.shape[0] * bodies.shape[2]
    shown: list[list[list[np.ndarray]]] = []
    sizes: list[int] = []
    stride, total = 1, 0
    for frame, row in enumerate(rows.tolist()):
        if frame % stride == 0:
            shown.append(_frame_outlines(recording, row))
            lengths = [len(outline) for view in shown[-1] for outline in view]
            # Two bytes for a difference, four for a point, a length or a count.
            sizes.append(packed_size(2 * sum(lengths) + 8 * len(lengths) + 4 * views * (points + 1)))
            total += sizes[-1]
            while total > room and len(shown) > 1:
                stride, shown, sizes = 2 * stride, shown[::2], sizes[::2]
                total = sum(sizes)
            if total > room:  # not even one frame fits
                shown = []
                break
        if on_frame is not None:
            on_frame(frame + 1)
    flat = [outline for views_ in shown for view in views_ for outline in view]
    return Overlays(
        stride=stride,
        counts=np.array([[len(view) for view in views_] for views_ in shown], np.int64).reshape(-1, views),
        lengths=np.array([len(outline) for outline in flat], np.int64),
        points=np.concatenate([np.empty((0, 2), np.int16), *flat]),
        skeletons=np.stack([drawn_skeletons(recording.cameras, body[::stride][: len(shown)]) for body in bodies]),
    )


def drawn_skeletons(
    cameras: Cameras, points: Float[np.ndarray, "frames points 3"]
) -> Int16[np.ndarray, "frames cams points 2"]:
    """Projections of joints and tips (world, m) into each view with lens distortion, in display units."""
    drawn = np.full((len(points), len(cameras), *points.shape[1:2], 2), UNSEEN, np.int16)
    there = np.isfinite(points).all(axis=(1, 2))
    if there.any():
        u, v, _ = project(cameras, points[there].reshape(-1, 3).astype(np.float64))
        for camera, size in enumerate(cameras.size):
            uv = np.stack([u[camera], v[camera]], -1).reshape(-1, points.shape[1], 2)
            drawn[there, camera] = to_units(uv, display_scale(size))
    return drawn


def _frame_outlines(recording: Recording, row: int) -> list[list[np.ndarray]]:
    found = []
    for packed, size in zip(recording.silhouettes[row], recording.cameras.size, strict=True):
        found.append(outlines(unpack_view(packed, size), display_scale(size)))
    return found
