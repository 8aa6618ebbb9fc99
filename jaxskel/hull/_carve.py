"""Space carving (Sect. 3): silhouettes to visual hulls, jit-compiled, 32 frames to a machine word.

Cameras and grid are static, so the pixel that each voxel falls on is looked up once and kept in a table. One gather
and one AND carve 32 frames, see `_frame_words`. Blocks of voxels go first, see `_blocks`.
"""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int, UInt8, UInt32

from .._runtime.compile_cache import cached_jit
from ._blocks import INNER, SomeBlocks, count_blocks, in_grid_order, pooled
from ._frame_bits import ALL_FRAMES, FRAMES_PER_WORD, Windows, cut_windows, frame_words, frames_of, listed, places_of
from ._projection_table import ProjectionTable
from ._visual_hulls import VisualHulls

_AT_ONCE = 1 << 9  # blocks


@cached_jit
def _carve_blocks(
    words: UInt32[Array, "cams places"], footprints: Int[Array, "cams blocks"], max_misses: int
) -> UInt32[Array, " blocks"]:
    """Carve blocks, each like a voxel, by the cells of the images that they are seen on."""
    return _carved(lambda camera: _at(words[camera], footprints[camera]), words.shape[0], max_misses)


@cached_jit
def _carve_some(
    words: UInt32[Array, "cams places"],
    corner: Int[Array | np.ndarray, "cams 2"],
    extent: tuple[int, int],
    pixels: Int[Array, "cams blocks inner"],
    observed: Bool[Array, "blocks inner"],
    size: tuple[int, int],
    blocks: Int[Array | np.ndarray, " some"],
    max_misses: int,
) -> UInt32[Array, "some inner"]:
    """Carve the voxels of some blocks."""

    def words_of(camera: int) -> UInt32[Array, "some inner"]:
        # Camera by camera, so that where a voxel is seen goes straight into the lookup of what is seen there.
        seen = _at(pixels[camera], jnp.asarray(blocks))
        return _at(words[camera], places_of(seen, jnp.asarray(corner)[camera], extent, size))

    return jnp.where(observed[blocks], _carved(words_of, words.shape[0], max_misses), jnp.uint32(0))


def _carved(
    words_of: Callable[[int], UInt32[Array, "*places"]], cameras: int, max_misses: int
) -> UInt32[Array, "*places"]:
    """Carve 32 frames at once: what stays is missed by at most `max_misses` cameras.

    Args:
        words_of: The frames in which a camera has the person at each place; all of them where it does not see it.
        cameras: How many there are.
        max_misses: Cameras that may see background.
    """
    # misses[k] has the bits of the frames in which more than k cameras missed the voxel so far.
    misses = [jnp.uint32(0)] * (max_misses + 1)
    for camera in range(cameras):
        miss = ~words_of(camera)
        for k in range(max_misses, 0, -1):
            misses[k] |= misses[k - 1] & miss
        misses[0] |= miss
    return ~misses[max_misses]


def _at(values: Array, indices: Int[Array, "*places"]) -> Array:
    """Values at indices that are known to be within bounds, which costs less."""
    return values.at[indices].get(mode="promise_in_bounds")


def _carve_word(windows: Windows, table: ProjectionTable, max_misses: int) -> SomeBlocks:
    """Carve 32 frames: first blocks of voxels, then the voxels of those that are left, a fixed number at a time."""
    words = frame_words(windows)
    where = windows.corner, windows.blank, *table.size
    blocks = np.asarray(_carve_blocks(pooled(words, *where), table.footprints, max_misses))
    left = np.flatnonzero(blocks[: count_blocks(table.grid.shape)] != 0).astype(np.int32)
    some_words, extent = listed(words, windows.blank), (words.shape[1], words.shape[2])
    inner = table.pixels_of_blocks, table.observed_of_blocks, table.size
    found: list[np.ndarray] = []
    for start in range(0, len(left), _AT_ONCE):
        some = np.resize(left[start : start + _AT_ONCE], _AT_ONCE)
        found.append(np.asarray(_carve_some(some_words, windows.corner, extent, *inner, some, max_misses)))
    return SomeBlocks(left, np.concatenate([np.zeros((0, INNER), np.uint32), *found])[: len(left)])


def carve(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    table: ProjectionTable,
    empty_views: Bool[np.ndarray, "frames cams"] | None = None,
    max_misses: int = 0,
) -> VisualHulls:
    """Carve the visual hulls of some frames.

    Args:
        silhouettes: Packed bits, 1 = person.
        table: From [`projection_table`][] for these cameras and image sizes.
        empty_views: Views that carve nothing in a frame, such as a black one.
        max_misses: k-of-n voting: a voxel stays while at most this many of the cameras that see it miss it.

    Returns:
        The occupied voxels of every frame.
    """
    frames, cams = silhouettes.shape[:2]
    empty_views = np.zeros((frames, cams), bool) if empty_views is None else empty_views
    found = []
    for start in range(0, frames, FRAMES_PER_WORD):
        part, gone = silhouettes[start : start + FRAMES_PER_WORD], empty_views[start : start + FRAMES_PER_WORD]
        # A full word always, so that a shorter last batch does not compile again; the bits of the rest are no one's.
        missing = FRAMES_PER_WORD - len(part)
        if missing:
            part = np.pad(part, ((0, missing), (0, 0), (0, 0), (0, 0)))
            gone = np.pad(gone, ((0, missing), (0, 0)))
        carved = _carve_word(cut_windows(part, gone), table, max_misses)
        found.append(SomeBlocks(carved.blocks, carved.words & (ALL_FRAMES >> np.uint32(missing))))
    voxels, words = in_grid_order(found, table.grid.shape)
    return VisualHulls(voxels, frames_of(words, frames), table.grid)
