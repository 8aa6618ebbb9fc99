"""The separate bodies of each frame of a room, without ghosts."""

from collections.abc import Callable

import cv2
import numpy as np
from jaxtyping import Bool, Int

from ..hull import FRAMES_PER_WORD, Bodies, VisualHulls, carve, find_bodies
from ..recording import Recording
from ._room import Room

CELL = 8
"""Edge of the square image cells in which people are told apart (px): a byte of packed bits."""
# A body with a smaller share of its image cells for itself, in every view, is a ghost: lines of sight through the
# silhouettes of others cross there.
_OWN_SHARE = 0.1
_LEAST = 0.004  # smaller bodies are parts of people, or noise (m^3)

Voxels = Int[np.ndarray, "_ 3"]


def bodies_of_frames(
    recording: Recording, room: Room, on_frames: Callable[[int], None] | None = None
) -> list[list[Voxels]]:
    """The voxels of each body in every frame, the largest body first; parts of people that are smaller are left out.

    `on_frames` is called with the number of frames done, to show progress.
    """
    assert room.table is not None
    found: list[list[Voxels]] = []
    for start in range(0, len(recording), FRAMES_PER_WORD):
        frames = slice(start, start + FRAMES_PER_WORD)
        silhouettes, gone = np.asarray(recording.silhouettes[frames]), room.empty_views[frames]
        hulls = carve(silhouettes, room.table, gone, room.max_misses)
        bodies = find_bodies(hulls)
        for frame in range(len(hulls)):
            found.append(_bodies_in(hulls, bodies, frame, room))
        if on_frames is not None:
            on_frames(len(found))
    return found


def _bodies_in(hulls: VisualHulls, bodies: Bodies, frame: int, room: Room) -> list[Voxels]:
    voxels = hulls.voxels[hulls.inside[frame]]
    body = bodies.voxels_of(frame)
    _, body, sizes = np.unique(body, return_inverse=True, return_counts=True)
    large = np.flatnonzero(sizes * hulls.grid.spacing**3 >= _LEAST)
    large = large[np.argsort(-sizes[large], kind="stable")]
    found = [voxels[body == one] for one in large]
    return _without_ghosts(found, room) if len(found) > 1 else found


def _without_ghosts(bodies: list[Voxels], room: Room) -> list[Voxels]:
    """Leave out bodies, one after the other, that explain no part of the silhouettes by themselves."""
    cells = [cells_of(voxels, room) for voxels in bodies]
    left = list(range(len(bodies)))
    while len(left) > 1:
        stacked = np.stack([cells[one] for one in left])
        alone = stacked & (stacked.sum(0) == 1)
        shares = (alone.sum((2, 3)) / np.maximum(stacked.sum((2, 3)), 1)).max(1)
        worst = len(shares) - 1 - int(np.argmin(shares[::-1]))  # the smallest of several
        if shares[worst] >= _OWN_SHARE:
            break
        del left[worst]
    return [bodies[one] for one in left]


def cells_of(voxels: Voxels, room: Room) -> Bool[np.ndarray, "cams rows columns"]:
    """The image cells onto which some voxels project."""
    assert room.table is not None
    height, width = room.table.size
    rows, columns = -(-height // CELL), width // CELL
    pixels = room.table.pixels_at(voxels)
    points = np.asarray(room.table.grid.origin) + room.table.grid.spacing * (voxels + 0.5)
    masks = np.zeros((len(pixels), rows, columns), np.uint8)
    for view, places in enumerate(pixels):
        places = places[places < room.table.unseen]
        if len(places) == 0:
            continue
        row, column = np.divmod(places, width)
        masks[view, row // CELL, column // CELL] = 1
        # Cells between the centres of neighbouring voxels.
        distance = np.linalg.norm(points - room.cameras.centres[view], axis=1).min()
        edge = float(room.cameras.K[view, 0, 0]) * room.table.grid.spacing / (distance * CELL)
        if edge > 0.7:
            side = 2 * int(np.ceil(edge)) + 1
            masks[view] = cv2.morphologyEx(masks[view], cv2.MORPH_CLOSE, np.ones((side, side), np.uint8))
    return masks.astype(bool)
