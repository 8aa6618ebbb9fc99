"""Details of silhouettes below the pixel resolution: gaps are closed, and outlines there get less weight."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from jaxskel import pack_silhouettes, unpack_silhouettes
from jaxskel.camera_calibration.from_silhouettes._closed_gaps import (
    outline_error,
    silhouettes_without_gaps,
    without_gaps,
)


def comb(gap: int, teeth: int = 4, height: int = 40) -> np.ndarray:
    """A hand that points down: teeth of two pixels, with gaps between them."""
    mask = np.zeros((height, 60), bool)
    mask[5:20, 20 : 20 + teeth * (2 + gap) - gap] = True
    for tooth in range(teeth):
        left = 20 + tooth * (2 + gap)
        mask[20:28, left : left + 2] = True
    return mask


@pytest.mark.parametrize("step", [1, 2, 3])
def test_gaps_of_two_cells_are_closed_and_wider_ones_are_not(step):
    for gap in range(1, 2 * step + 3):
        mask = comb(gap)
        closed = without_gaps(mask, step)
        left, right = np.flatnonzero(mask.any(0))[[0, -1]]
        filled = closed[22:26, left : right + 1]
        assert filled.all() == (gap <= 2 * step)
        # The tips are where they were.
        np.testing.assert_array_equal(closed.any(1), mask.any(1))
        np.testing.assert_array_equal(closed.any(0), mask.any(0))


@given(arrays(bool, (12, 16)))
def test_nobody_gets_smaller_and_no_edge_is_reached(mask):
    closed = without_gaps(mask, 1)
    assert (closed | ~mask).all()
    np.testing.assert_array_equal(without_gaps(closed, 1), closed)
    for edge in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
        assert closed[edge].any() == mask[edge].any()


def test_packed_silhouettes_are_closed_one_by_one():
    masks = np.zeros((2, 2, 40, 60), bool)
    masks[0, 0], masks[1, 1] = comb(1), comb(2)
    found = unpack_silhouettes(silhouettes_without_gaps(pack_silhouettes(masks), 1), 60)
    for frame in range(2):
        for view in range(2):
            np.testing.assert_array_equal(found[frame, view], without_gaps(masks[frame, view], 1))


@given(st.floats(0, 2 * np.pi), st.floats(-3, 3), st.sampled_from([1, 2, 3]))
def test_a_straight_edge_is_resolved(angle, offset, step):
    v, u = np.mgrid[-30:31, -30:31]
    half = u * np.cos(angle) + v * np.sin(angle) < offset
    inner = np.s_[16:-16, 16:-16]  # the edges of the image are none of the person's
    np.testing.assert_array_equal(outline_error(half, step)[inner], 1.0)


def test_the_error_counts_what_is_unlike_its_neighbours_nearby():
    mask = np.zeros((40, 60), bool)
    mask[:20] = True
    mask[30, 30] = True  # a speck
    mask[8, 10], mask[8, 12] = False, False  # two holes
    error = outline_error(mask, 1)
    assert error[26, 30] == error[34, 34] == pytest.approx(np.sqrt(2))
    assert error[25, 30] == error[30, 35] == 1.0
    assert error[8, 11] == pytest.approx(np.sqrt(3))
    assert error[8, 7] == pytest.approx(np.sqrt(2))
    # So many pixels of a larger image are a cell.
    coarse = outline_error(np.kron(mask, np.ones((3, 3), bool)), 3)
    assert coarse[3 * 8 + 1, 3 * 11 + 1] == pytest.approx(np.sqrt(3))
    assert coarse[3 * 30 + 1, 3 * 36 + 1] == 1.0


def test_fingers_are_poorly_resolved_and_a_fist_is_not():
    fingers, fist = comb(1), without_gaps(comb(1), 1)
    tip = np.s_[27, 21:29]
    assert outline_error(fingers, 1)[tip].min() > 1.5 * outline_error(fist, 1)[tip].max()
