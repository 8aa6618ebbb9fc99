"""Space carving (Sect. 3): silhouettes to visual hulls, 32 frames to a machine word.

Cameras and grid are static, so the pixel that each voxel falls on is looked up once and kept in a table. One look-up
and one AND carve 32 frames, see `_frame_words`. Blocks of voxels go first, see `_blocks`. Looking up is NumPy's part:
it takes half the time that a compiled gather takes, and needs no fixed number of blocks.
"""

from collections.abc import Iterable

import numpy as np
from jaxtyping import Bool, Int, UInt8, UInt32

from ._blocks import INNER, SomeBlocks, count_blocks, in_grid_order, pooled
from ._frame_words import FRAMES_PER_WORD, Windows, cut_windows, frame_words, frames_of, whole_images
from ._hull import VisualHulls
from ._projection import ProjectionTable

_ALL = np.uint32(0xFFFFFFFF)
# Blocks that are looked up at once. What many more of them need does not stay in the processor's cache.
_AT_ONCE = 1 << 13


def carve_words(
    occupied: UInt32[np.ndarray, "*some"],
    words: Iterable[UInt32[np.ndarray, " places"]],
    seen: Iterable[Int[np.ndarray, "*some"]],
    max_misses: int = 0,
) -> UInt32[np.ndarray, "*some"]:
    """Carve 32 frames at once: what stays is missed by at most `max_misses` cameras.

    Args:
        occupied: The frames in which each voxel, or block of voxels, is there to be carved.
        words: Camera by camera, of its pixels, or cells of them, and of what it does not see.
        seen: Camera by camera, which of them each voxel or block is seen on.
        max_misses: Cameras that may see background.
    """
    # kept[k] has the bits of the frames in which at most k cameras missed the voxel so far.
    kept = [occupied.copy() for _ in range(max_misses + 1)]
    for words_of_camera, seen_by_camera in zip(words, seen, strict=True):
        hit = words_of_camera.take(seen_by_camera)
        for k in range(max_misses, 0, -1):
            kept[k] &= hit
            kept[k] |= kept[k - 1]
        kept[0] &= hit
    return kept[max_misses]


def _carve_word(windows: Windows, table: ProjectionTable, max_misses: int) -> SomeBlocks:
    """Carve 32 frames: first blocks of voxels, then the voxels of those that are left."""
    words = frame_words(windows)
    cells = np.asarray(pooled(words, windows.corner, windows.blank, *table.size))
    every = np.full(count_blocks(table.grid.shape), _ALL)
    left = np.flatnonzero(carve_words(every, cells, table.footprints, max_misses) != 0)
    carved = np.empty((len(left), INNER), np.uint32)
    for start in range(0, len(left), _AT_ONCE):
        some = left[start : start + _AT_ONCE]
        observed = table.observed_of_blocks.take(some, axis=0)
        images = whole_images(np.asarray(words), windows, *table.size)
        seen = (pixels.take(some, axis=0) for pixels in table.pixels_of_blocks)
        carved[start : start + _AT_ONCE] = carve_words(np.where(observed, _ALL, np.uint32(0)), images, seen, max_misses)
    return SomeBlocks(left, carved)


def carve(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    table: ProjectionTable,
    lost: Bool[np.ndarray, "frames cams"] | None = None,
    max_misses: int = 0,
) -> VisualHulls:
    """Carve the visual hulls of some frames.

    Args:
        silhouettes: Packed bits, 1 = person.
        table: From [`projection_table`][] for these cameras and image sizes.
        lost: Views that carve nothing in a frame, such as a black one.
        max_misses: k-of-n voting: a voxel stays while at most this many of the cameras that see it miss it.

    Returns:
        The occupied voxels of every frame.
    """
    frames, cams = silhouettes.shape[:2]
    lost = np.zeros((frames, cams), bool) if lost is None else lost
    found = []
    for start in range(0, frames, FRAMES_PER_WORD):
        part, gone = silhouettes[start : start + FRAMES_PER_WORD], lost[start : start + FRAMES_PER_WORD]
        # A full word always, so that a shorter last batch does not compile again; the bits of the rest are no one's.
        missing = FRAMES_PER_WORD - len(part)
        if missing:
            part = np.pad(part, ((0, missing), (0, 0), (0, 0), (0, 0)))
            gone = np.pad(gone, ((0, missing), (0, 0)))
        carved = _carve_word(cut_windows(part, gone), table, max_misses)
        found.append(SomeBlocks(carved.blocks, carved.words & (_ALL >> np.uint32(missing))))
    voxels, words = in_grid_order(found, table.grid.shape)
    return VisualHulls(voxels, frames_of(words, frames), table.grid)
