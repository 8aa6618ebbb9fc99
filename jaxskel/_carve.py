"""Space carving (Sect. 3): silhouettes to visual hulls, jit-compiled, 32 frames to a machine word.

Cameras and grid are static, so the pixel that each voxel falls on is looked up once and kept in a table. Bit f of a
word belongs to frame f: one gather and one AND carve 32 frames. Blocks of voxels go first, see `_blocks`.
"""

from functools import reduce

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int, UInt8, UInt32

from ._blocks import count_blocks, pooled, voxels_of
from ._hull import VisualHulls
from ._kept import kept
from ._projection import ProjectionTable

FRAMES_PER_WORD = 32
_ALL = np.uint32(0xFFFFFFFF)
_AT_ONCE = 1 << 15  # voxels


@kept
def frame_words(
    packed: UInt8[Array | np.ndarray, "frames=32 cams h w8"], lost: Bool[Array | np.ndarray, "frames=32 cams"]
) -> UInt32[Array, "cams pixels"]:
    """Turn the packed bits of 32 frames into one word a pixel.

    A lost view is all ones in its frame, so it carves nothing.
    """
    bit = jnp.arange(FRAMES_PER_WORD, dtype=jnp.uint32)
    lost_words = (lost.astype(jnp.uint32) << bit[:, None]).sum(0, dtype=jnp.uint32)
    quarters = [_transposed([packed[f + k] for k in range(8)]) for f in range(0, FRAMES_PER_WORD, 8)]
    columns = [
        reduce(
            jnp.bitwise_or,
            (part.astype(jnp.uint32) << (8 * i) for i, part in enumerate(parts)),
            lost_words[:, None, None],
        )
        for parts in zip(*quarters, strict=True)
    ]
    return jnp.stack(columns, -1).reshape(packed.shape[1], -1)


def _transposed(rows: list[UInt8[Array, "*image"]]) -> list[UInt8[Array, "*image"]]:
    """Bit k of the i-th of eight bytes becomes bit i of the k-th byte, counted from the highest.

    Blocks of four, of two and of one bit change places (Warren, *Hacker's Delight*, 7-3), for all pixels at once.
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


@kept
def carve_words(
    words: UInt32[Array, "cams places"], seen: Int[Array, "cams some"], max_misses: int = 0
) -> UInt32[Array, " some"]:
    """Carve 32 frames at once: what stays is missed by at most `max_misses` cameras.

    Args:
        words: Of each camera's pixels, or cells of them.
        seen: Which of them each voxel, or block of voxels, is seen on; one past the last where it is not seen.
        max_misses: Cameras that may see background.
    """
    # misses[k] has the bits of the frames in which more than k cameras missed the voxel so far.
    misses = [jnp.zeros(seen.shape[1], jnp.uint32) for _ in range(max_misses + 1)]
    for c in range(words.shape[0]):
        miss = ~words[c].at[seen[c]].get(mode="fill", fill_value=_ALL)
        for k in range(max_misses, 0, -1):
            misses[k] |= misses[k - 1] & miss
        misses[0] |= miss
    return ~misses[max_misses]


@kept
def _carve_some(
    words: UInt32[Array, "cams pixels"],
    pixels: Int[Array, "cams voxels"],
    observed: Bool[Array, " voxels"],
    voxels: Int[Array | np.ndarray, " some"],
    max_misses: int,
) -> UInt32[Array, " some"]:
    """Carve some voxels of the grid."""
    seen = pixels.at[:, voxels].get(mode="promise_in_bounds")
    return jnp.where(observed[voxels], carve_words(words, seen, max_misses), jnp.uint32(0))


def _carve_word(
    words: UInt32[Array, "cams pixels"], table: ProjectionTable, max_misses: int
) -> UInt32[np.ndarray, " voxels"]:
    """Carve 32 frames: first blocks of voxels, then the voxels of those that are left, a fixed number at a time."""
    blocks = np.asarray(carve_words(pooled(words, *table.size), table.padded_footprints, max_misses))
    voxels = voxels_of(np.flatnonzero(blocks[: count_blocks(table.grid.shape)]), table.grid.shape)
    found = np.zeros(table.grid.size, np.uint32)
    for start in range(0, len(voxels), _AT_ONCE):
        some = voxels[start : start + _AT_ONCE]
        full = np.resize(some, _AT_ONCE) if len(some) < _AT_ONCE else some
        carved = _carve_some(words, table.padded_pixels, table.padded_observed, full, max_misses)
        found[some] = np.asarray(carved)[: len(some)]
    return found


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
    words = []
    for start in range(0, frames, FRAMES_PER_WORD):
        part, gone = silhouettes[start : start + FRAMES_PER_WORD], lost[start : start + FRAMES_PER_WORD]
        # A full word always, so that a shorter last batch does not compile again; the bits of the rest are no one's.
        missing = FRAMES_PER_WORD - len(part)
        if missing:
            part = np.pad(part, ((0, missing), (0, 0), (0, 0), (0, 0)))
            gone = np.pad(gone, ((0, missing), (0, 0)))
        words.append(_carve_word(frame_words(part, gone), table, max_misses) & (_ALL >> np.uint32(missing)))
    occupied = np.flatnonzero(reduce(np.bitwise_or, words, np.zeros(table.grid.size, np.uint32)))
    inside = np.empty((frames, len(occupied)), bool)
    for i, word in enumerate(words):
        own = word.take(occupied)
        for f in range(i * FRAMES_PER_WORD, min(frames, (i + 1) * FRAMES_PER_WORD)):
            np.not_equal(own & np.uint32(1 << f % FRAMES_PER_WORD), 0, out=inside[f])
    voxels = np.stack(np.unravel_index(occupied, table.grid.shape), -1).astype(np.int32)
    return VisualHulls(voxels, inside, table.grid)
