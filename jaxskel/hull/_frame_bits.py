"""32 frames per machine word: bit f of a pixel's word belongs to frame f, so one AND carves 32 frames.

A person fills a small part of an image. Only a window around it, the same in all frames, is converted to words. The
bits of a frame by itself stay as they are packed.
"""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int, UInt, UInt8, UInt32

from .._runtime.batching import step_above
from .._runtime.compile_cache import cached_jit
from .._runtime.materialise import computed_once

FRAMES_PER_WORD = 32
# Bytes of each frame that become words at once: a fixed number, so that one program does for any rig and any images.
_AT_ONCE = 1 << 14
CELL = 8
"""Edge of the square cells that make up a window (px): one byte of a packed row, and as many rows."""


class Windows(NamedTuple):
    """For each camera, the part of its silhouettes that contains all person pixels of 32 frames.

    Attributes:
        corner: Upper left corner of each window in its image: row (a multiple of `CELL`) and byte.
        blank: Word of all other pixels: ones in the frames in which the view is empty, so that it carves nothing.
    """

    packed: UInt8[np.ndarray, "frames=32 cams rows w8"]
    corner: Int[np.ndarray, "cams 2"]
    blank: UInt32[np.ndarray, " cams"]


def all_frames(words: Any) -> np.unsignedinteger:
    """Word, of the type of others, of places that a camera does not see: it carves nothing there, in any frame."""
    return words.dtype.type(np.iinfo(words.dtype).max)


def cut_windows(packed: UInt8[np.ndarray, "frames cams h w8"], empty_views: Bool[np.ndarray, "frames cams"]) -> Windows:
    """Cut windows of the same size out of the images of all cameras; they may extend below the image.

    Args:
        packed: Packed bits of 32 frames.
        empty_views: Views that show no person.
    """
    height, width = packed.shape[2:]
    some = np.bitwise_or.reduce(packed, 0)
    bounds = [[_bounds(each.any(axis)) for axis in (1, 0)] for each in some]
    first = [(rows[0] // CELL * CELL, columns[0]) for rows, columns in bounds]
    last = [(rows[1], columns[1]) for rows, columns in bounds]
    extent = np.subtract(last, first).max(0)
    whole = -(-height // CELL) * CELL
    rows, columns = min(CELL * step_above(-(-int(extent[0]) // CELL)), whole), min(step_above(int(extent[1])), width)
    corner = np.minimum(first, (whole - rows, width - columns)).astype(np.int32)
    windows = np.zeros((len(packed), len(some), rows, columns), np.uint8)
    for camera, (top, left) in enumerate(corner):
        part = packed[:, camera, top : top + rows, left : left + columns]
        windows[:, camera, : part.shape[1]] = part
    blank = np.left_shift(empty_views.astype(np.uint32), np.arange(len(packed), dtype=np.uint32)[:, None])
    return Windows(windows, corner, np.bitwise_or.reduce(blank, 0))


def frame_words(windows: Windows) -> UInt32[np.ndarray, "cams places"]:
    """One word per pixel, from the packed bits of 32 frames.

    For each camera, the words of the window's pixels, then that of all other pixels, then that of unseen places.
    """
    frames, cams = windows.packed.shape[:2]
    packed = windows.packed.reshape(frames, -1)
    own = np.empty(CELL * packed.shape[1], np.uint32)
    for start in range(0, packed.shape[1], _AT_ONCE):
        part = packed[:, start : start + _AT_ONCE]
        count = part.shape[1]
        part = part if count == _AT_ONCE else np.pad(part, ((0, 0), (0, _AT_ONCE - count)))
        own[CELL * start : CELL * (start + count)] = np.asarray(_words_of(part))[: CELL * count]
    words = np.empty((cams, len(own) // cams + 2), np.uint32)
    np.bitwise_or(own.reshape(cams, -1), windows.blank[:, None], out=words[:, :-2])
    words[:, -2], words[:, -1] = windows.blank, all_frames(words)
    return words


@cached_jit
def _words_of(packed: UInt8[Array | np.ndarray, "frames=32 bytes"]) -> UInt32[Array, " pixels"]:
    """Transpose packed bits of 32 frames into one word per pixel."""
    anything = packed[0, 0].astype(jnp.float32)
    quarters = jnp.asarray(packed).reshape(FRAMES_PER_WORD // 8, 8, -1)
    # Materialise intermediate results: interleaving bytes and words then runs at memory speed.
    bits = computed_once(jnp.stack(_transposed([quarters[:, row] for row in range(8)])), anything)  # 8 quarters bytes
    words = computed_once(jax.lax.bitcast_convert_type(jnp.moveaxis(bits, 1, -1), jnp.uint32), anything)
    return words.T.reshape(-1)


def cell_words(
    words: UInt32[np.ndarray, "cams places"], extent: tuple[int, int]
) -> UInt32[np.ndarray, "cams rows columns"]:
    """For each cell of the windows, the frames with any person pixel in it; in NumPy, so that nothing is compiled.

    Args:
        words: From `frame_words`.
        extent: Rows and columns of the windows (px).
    """
    rows = words[:, : math.prod(extent)].reshape(len(words), extent[0] // CELL, CELL, extent[1])
    cells = np.asarray(np.bitwise_or.reduce(rows, 2))
    while cells.shape[2] > extent[1] // CELL:  # by halves, because NumPy is slow where an axis is short
        cells = cells[:, :, ::2] | cells[:, :, 1::2]
    return cells


def cells_of_frame(packed: UInt8[np.ndarray, "cams h w8"]) -> UInt8[np.ndarray, "cams rows columns"]:
    """For each cell of the images of one frame, whether there is any person pixel in it."""
    cams, height, columns = packed.shape
    packed = np.pad(packed, ((0, 0), (0, -height % CELL), (0, 0)))
    rows = packed.reshape(cams, -1, CELL, columns)
    return (np.bitwise_or.reduce(rows, 2) != 0).astype(np.uint8)


def places_of(
    pixels: Int[Array, "*some"], corner: Int[Array, "2"], extent: tuple[int, int], size: tuple[int, int]
) -> Int[Array, "*some"]:
    """Indices into the result of `frame_words` for some pixels of one camera.

    Args:
        pixels: Indices into the flattened image; one past its end means not seen.
        corner: Row and byte of the camera's window.
        extent: Rows and columns of the window (px).
        size: Height and width of the image (px).
    """
    inner, unseen = math.prod(extent), math.prod(size)
    # Unsigned, so that positions before the window wrap around to large numbers and one comparison tests both bounds.
    first, index, width = (corner * jnp.array([1, CELL])).astype(jnp.uint32), pixels.astype(jnp.uint32), size[1]
    row = index // jnp.uint32(width) - first[0]
    column = index % jnp.uint32(width) - first[1]
    within = (row < extent[0]) & (column < extent[1])
    there = jnp.where(within, row * jnp.uint32(extent[1]) + column, jnp.uint32(inner))
    return jnp.where(pixels == unseen, inner + 1, there.astype(jnp.int32))


def frames_of(words: UInt[np.ndarray, "words n"], frames: int) -> Bool[np.ndarray, "frames n"]:
    """Unpack the bits of words, one row per frame."""
    bits = np.empty((frames, words.shape[1]), bool)
    for start in range(0, frames, 8):  # bytes are tested faster than words
        part = (words[start // FRAMES_PER_WORD] >> words.dtype.type(start % FRAMES_PER_WORD)).astype(np.uint8)
        for bit, frame in enumerate(bits[start : start + 8]):
            np.not_equal(part & np.uint8(1 << bit), 0, out=frame)
    return bits


def _transposed(rows: list[UInt8[Array, "*image"]]) -> list[UInt8[Array, "*image"]]:
    """Bit k of the i-th of eight bytes becomes bit i of the k-th byte, counted from the highest.

    This transposes 8 x 8 bits (Warren, *Hacker's Delight*, 7-3) by swapping blocks of four, two and one bits.
    """
    for distance, mask in ((4, np.uint8(0x0F)), (2, np.uint8(0x33)), (1, np.uint8(0x55))):
        swapped = list(rows)
        for i in range(8):
            if not i & distance:
                other = i + distance
                change = ((rows[i] >> distance) ^ rows[other]) & mask
                swapped[i], swapped[other] = rows[i] ^ (change << distance), rows[other] ^ change
        rows = swapped
    return rows[::-1]


def _bounds(some: Bool[np.ndarray, " n"]) -> tuple[int, int]:
    """First and one past the last true index; (0, 0) if there is none."""
    there = np.flatnonzero(some)
    return (int(there[0]), int(there[-1]) + 1) if len(there) else (0, 1)
