"""Space carving (Sect. 3): silhouettes to visual hulls, jit-compiled, 32 frames per machine word.

Cameras and grid are static, so a table holds the pixel that each voxel projects onto. Per camera, one gather and one
AND carve 32 frames, see `_frame_bits`. Blocks of voxels are carved first, see `_blocks`.
"""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int, UInt, UInt8

from .._runtime.compile_cache import cached_jit
from ._blocks import INNER, SomeBlocks, count_blocks, in_grid_order, pooled
from ._frame_bits import (
    FRAMES_PER_WORD,
    Windows,
    cell_words,
    cells_of_frame,
    cut_windows,
    frame_words,
    frames_of,
    places_of,
)
from ._projection_table import ProjectionTable
from ._visual_hulls import VisualHulls

_AT_ONCE = 1 << 9  # blocks per call: a fixed number, so that the call compiles once


@cached_jit
def _carve_blocks(
    words: UInt[Array | np.ndarray, "cams places"], footprints: Int[Array, "cams blocks"], max_misses: int
) -> UInt[Array, " blocks"]:
    """Carve whole blocks like voxels, using the image cells that they project onto."""
    own = jnp.asarray(words)
    return _carved(lambda camera: _at(own[camera], footprints[camera]), len(own), max_misses, own.dtype)


@cached_jit
def _carve_some(
    words: UInt[Array, "cams places"],
    corner: Int[Array | np.ndarray, "cams 2"],
    extent: tuple[int, int],
    pixels: Int[Array, "cams blocks inner"],
    observed: Bool[Array, "blocks inner"],
    size: tuple[int, int],
    blocks: Int[Array | np.ndarray, " some"],
    max_misses: int,
) -> UInt[Array, "some inner"]:
    """Carve the voxels of the given blocks."""

    def words_of(camera: int) -> UInt[Array, "some inner"]:
        # One camera at a time, so that the pixel lookup feeds the silhouette lookup directly.
        seen = _at(pixels[camera], jnp.asarray(blocks))
        return _at(words[camera], places_of(seen, jnp.asarray(corner)[camera], extent, size))

    return jnp.where(observed[blocks], _carved(words_of, words.shape[0], max_misses, words.dtype), words.dtype.type(0))


def _carved(
    words_of: Callable[[int], UInt[Array, "*places"]], cameras: int, max_misses: int, word: Any
) -> UInt[Array, "*places"]:
    """Carve all frames of a word at once: keep the places that at most `max_misses` cameras miss.

    Args:
        words_of: For a camera, the frames in which each place falls on the person; all frames if it is not seen.
        cameras: Number of cameras.
        max_misses: Number of cameras that may see background.
        word: Type of the words.
    """
    # Bit f of misses[k] is set if more than k cameras so far missed the place in frame f.
    misses = [jnp.zeros((), word)] * (max_misses + 1)
    for camera in range(cameras):
        miss = ~words_of(camera)
        for k in range(max_misses, 0, -1):
            misses[k] |= misses[k - 1] & miss
        misses[0] |= miss
    return ~misses[max_misses]


def _at(values: Array, indices: Int[Array, "*places"]) -> Array:
    """Gather without bounds checks, for indices known to be within bounds."""
    return values.at[indices].get(mode="promise_in_bounds")


def _carve_word(windows: Windows, table: ProjectionTable, max_misses: int) -> SomeBlocks:
    """Carve a word of frames."""
    words, extent = frame_words(windows), (windows.packed.shape[2], 8 * windows.packed.shape[3])
    cells = pooled(cell_words(words, extent), windows.corner, windows.blank, *table.size)
    on_device, inner = jnp.asarray(words), (table.pixels_of_blocks, table.observed_of_blocks, table.size)

    def carve_some(blocks: Int[np.ndarray, " some"]) -> UInt[Array, "some inner"]:
        return _carve_some(on_device, windows.corner, extent, *inner, blocks, max_misses)

    return _in_blocks(cells, table, max_misses, carve_some)


def _in_blocks(
    cells: UInt[np.ndarray, "cams cells"],
    table: ProjectionTable,
    max_misses: int,
    carve_some: Callable[[Int[np.ndarray, " some"]], UInt[Array, "some inner"]],
) -> SomeBlocks:
    """Carve first blocks, then the voxels of the rest, a fixed number of blocks at a time."""
    blocks = np.asarray(_carve_blocks(cells, table.footprints, max_misses))
    left = np.flatnonzero(blocks[: count_blocks(table.grid.shape)] != 0).astype(np.int32)
    found = [np.zeros((0, INNER), cells.dtype)]
    for start in range(0, len(left), _AT_ONCE):
        found.append(np.asarray(carve_some(np.resize(left[start : start + _AT_ONCE], _AT_ONCE))))
    return SomeBlocks(left, np.concatenate(found)[: len(left)])


@cached_jit
def _carve_some_of_one(
    packed: UInt8[Array, "cams bytes"],
    pixels: Int[Array, "cams blocks inner"],
    observed: Bool[Array, "blocks inner"],
    blocks: Int[Array | np.ndarray, " some"],
    max_misses: int,
) -> UInt8[Array, "some inner"]:
    """As `_carve_some`, for one frame: the bit of each pixel is looked up where it lies, in a byte of its own row."""

    def words_of(camera: int) -> UInt8[Array, "some inner"]:
        pixel = _at(pixels[camera], jnp.asarray(blocks))
        return _at(packed[camera], pixel >> 3) >> (7 - (pixel & 7)).astype(jnp.uint8) & jnp.uint8(1)

    return jnp.where(observed[blocks], _carved(words_of, packed.shape[0], max_misses, packed.dtype), jnp.uint8(0))


def _carve_one(
    packed: UInt8[np.ndarray, "cams h w8"], empty: Bool[np.ndarray, " cams"], table: ProjectionTable, max_misses: int
) -> SomeBlocks:
    """Carve one frame, as `_carve_word` does 32 frames: its packed bits are the words."""
    seen = np.where(empty[:, None, None], np.uint8(0xFF), packed)
    everywhere = np.zeros((len(packed), 2), np.int32)
    cells = pooled(cells_of_frame(seen), everywhere, np.zeros(len(packed), np.uint8), *table.size)
    # One byte more, for places that are not seen.
    places = np.full((len(packed), seen[0].size + 1), 0xFF, np.uint8)
    places[:, :-1] = seen.reshape(len(packed), -1)
    on_device, inner = jnp.asarray(places), (table.pixels_of_blocks, table.observed_of_blocks)
    return _in_blocks(cells, table, max_misses, lambda some: _carve_some_of_one(on_device, *inner, some, max_misses))


def carve(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    table: ProjectionTable,
    empty_views: Bool[np.ndarray, "frames cams"] | None = None,
    max_misses: int = 0,
    at_once: int = FRAMES_PER_WORD,
) -> VisualHulls:
    """Carve the visual hull of each frame (Sect. 3).

    Args:
        silhouettes: Packed bits, 1 = person.
        table: From [`projection_table`][] for these cameras and image sizes.
        empty_views: Views that carve nothing in a frame, such as black images.
        max_misses: k-of-n voting: a voxel stays if at most this many of the cameras that see it show background there.
        at_once: Frames in a word, 32 or 1; fewer frames than this are padded.

    Returns:
        The occupied voxels of every frame, on the table's grid.

    Raises:
        ValueError: The silhouettes are not packed, or of other cameras or image sizes than the table.
    """
    frames, cams = silhouettes.shape[:2]
    wanted = len(table.footprints), table.size[0], table.size[1] // 8
    if silhouettes.shape[1:] != wanted or silhouettes.dtype != np.uint8:
        raise ValueError(
            f"silhouettes: have shape {silhouettes.shape}, {silhouettes.dtype}; give packed bits of shape (frames, "
            f"{', '.join(map(str, wanted))}), as the table is made for"
        )
    empty_views = np.zeros((frames, cams), bool) if empty_views is None else empty_views
    found = []
    for start in range(0, frames, at_once):
        part, gone = silhouettes[start : start + at_once], empty_views[start : start + at_once]
        if at_once == 1:
            carved = _carve_one(part[0], gone[0], table, max_misses)
        else:
            # Pad to a full word, so that a shorter last batch does not recompile; the padding bits are cleared below.
            missing = at_once - len(part)
            if missing:
                part = np.pad(part, ((0, missing), (0, 0), (0, 0), (0, 0)))
                gone = np.pad(gone, ((0, missing), (0, 0)))
            carved = _carve_word(cut_windows(part, gone), table, max_misses)
        own = carved.words.dtype.type((1 << min(at_once, frames - start)) - 1)
        found.append(SomeBlocks(carved.blocks, carved.words & own))
    voxels, words = in_grid_order(found, table.grid.shape)
    return VisualHulls(voxels, frames_of(words, frames), table.grid)
