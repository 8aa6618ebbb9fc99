"""Words of 32 frames: bit f of a pixel's word is the pixel in frame f, wherever in the image the person is."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxskel.hull import FRAMES_PER_WORD
from jaxskel.hull._frame_bits import CELL, Windows, cell_words, cut_windows, frame_words, frames_of, places_of

CAMS, WIDTH = 3, 160


def whole_images(windows: Windows, height: int, width: int) -> np.ndarray:
    """The word of each pixel, and the word of unseen places."""
    rows, columns = windows.packed.shape[2:]
    every, extent = jnp.arange(height * width + 1, dtype=jnp.int32), (rows, 8 * columns)
    found = []
    for own, corner in zip(frame_words(windows), windows.corner, strict=True):
        found.append(own[np.asarray(places_of(every, jnp.asarray(corner), extent, (height, width)))])
    return np.stack(found)


@pytest.mark.parametrize("height", [96, 101])
@pytest.mark.parametrize("box", [(0, 0, 0, 0), (40, 41, 17, 18), (5, 60, 30, 100), (90, 96, 150, 160), (0, 96, 0, 160)])
def test_each_bit_is_a_frame(height, box):
    rng = np.random.default_rng(0)
    masks = np.zeros((FRAMES_PER_WORD, CAMS, height, WIDTH), bool)
    top, bottom, left, right = box
    # The first camera sees nothing, the others see different images.
    masks[:, 1, top:bottom, left:right] = rng.random((FRAMES_PER_WORD, bottom - top, right - left)) < 0.3
    masks[3, 2, : bottom // 2, : right // 2] = True
    empty_views = rng.random((FRAMES_PER_WORD, CAMS)) < 0.1
    windows = cut_windows(np.packbits(masks, -1), empty_views)
    words = whole_images(windows, height, WIDTH)
    bits = (masks | empty_views[:, :, None, None]).astype(np.uint32) << np.arange(FRAMES_PER_WORD)[:, None, None, None]
    np.testing.assert_array_equal(words[:, :-1], np.bitwise_or.reduce(bits, 0).astype(np.uint32).reshape(CAMS, -1))
    np.testing.assert_array_equal(words[:, -1], 0xFFFFFFFF)  # what is not seen
    rows, columns = windows.packed.shape[2:]
    cells = cell_words(frame_words(windows), (rows, 8 * columns))
    some = windows.packed.reshape(FRAMES_PER_WORD, CAMS, rows // CELL, CELL, columns).any(3)
    for frame, own in enumerate(some):
        np.testing.assert_array_equal(cells >> np.uint32(frame) & 1, own | empty_views[frame, :, None, None])


def test_a_window_is_as_large_as_the_person_asks_for():
    masks = np.zeros((FRAMES_PER_WORD, CAMS, 480, 640), bool)
    masks[5:9, :, 100:230, 300:340] = True
    windows = cut_windows(np.packbits(masks, -1), np.zeros((FRAMES_PER_WORD, CAMS), bool))
    rows, columns = windows.packed.shape[2:]
    assert 130 <= rows < 1.25 * 130 + 2 * CELL
    assert 40 / 8 <= columns < 1.25 * 40 / 8 + 2


@pytest.mark.parametrize("frames", [1, 12, 32, 33, 64])
def test_words_are_taken_apart_again(frames):
    bits = np.random.default_rng(0).random((frames, 7)) < 0.5
    powers = np.uint32(1) << np.arange(FRAMES_PER_WORD, dtype=np.uint32)[:, None]
    starts = range(0, frames, FRAMES_PER_WORD)
    parts = [bits[start : start + FRAMES_PER_WORD] for start in starts]
    words = np.stack([(part * powers[: len(part)]).sum(0, dtype=np.uint32) for part in parts])
    np.testing.assert_array_equal(frames_of(words, frames), bits)
