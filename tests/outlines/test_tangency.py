"""Outermost epipolar tangents: they coincide for the silhouettes of a right rig, and not for those of a wrong one."""

import numpy as np
import pytest
from support.outline_sets import outlines
from support.perturbed_rigs import perturbed
from support.undescribed_folders import FRAMES, SIZE, VIEWS, masks, rig

from jaxskel.outlines import convex_outline, pairs_of, tangent_misses


def test_the_outline_is_that_of_the_largest_part():
    image = np.zeros((20, 30), np.uint8)
    image[5:15, 8:20] = 1
    image[8:12, 20:22] = 1
    image[0, 0] = 1
    outline = convex_outline(np.packbits(image, axis=-1), 30, 20)
    assert outline is not None
    assert {tuple(point) for point in outline.uv.astype(int)} == {(8, 5), (8, 14), (19, 5), (19, 14), (21, 8), (21, 11)}
    assert not outline.cut.any()


def test_points_at_an_edge_of_the_image_are_cut_and_black_is_nothing():
    image = np.zeros((20, 30), np.uint8)
    assert convex_outline(np.packbits(image, axis=-1), 30, 20) is None
    image[10:, 5:9] = 1
    outline = convex_outline(np.packbits(image, axis=-1), 30, 20)
    assert outline is not None
    assert {tuple(point) for point in outline.uv[outline.cut].astype(int)} == {(5, 19), (8, 19)}


def test_tangents_of_a_right_rig_miss_each_other_by_less_than_a_pixel():
    misses = tangent_misses(rig(), outlines(masks()), FRAMES)
    assert misses.shape == (VIEWS * (VIEWS - 1) // 2, FRAMES, 2)
    there = misses[np.isfinite(misses)]
    assert len(there) > 0.8 * misses.size
    assert np.median(there) < 0.3
    assert there.max() < 1.0


@pytest.mark.parametrize("seed", range(3))
def test_those_of_a_wrong_rig_miss_by_more(seed):
    seen = outlines(masks())
    right, wrong = (
        np.nanmedian(tangent_misses(cameras, seen, FRAMES)) for cameras in (rig(), perturbed(rig(), seed, 0.03, 0.0))
    )
    assert wrong > 5 * right


def test_a_view_that_is_wrong_is_wrong_in_its_own_pairs_only():
    images = masks().copy()
    images[:, 2] = images[:, 2, :, ::-1]
    right, wrong = (tangent_misses(rig(), outlines(each), FRAMES) for each in (masks(), images))
    with_it = (np.array(pairs_of(VIEWS)) == 2).any(1)
    np.testing.assert_array_equal(wrong[~with_it], right[~with_it])
    assert np.nanmedian(wrong[with_it]) > 5 * np.nanmedian(right[with_it])


def test_where_the_image_cuts_the_person_off_nothing_is_known():
    images = masks().copy()
    head = int(np.nonzero(images[0, 0].any(1))[0][0])
    cut = images[:1, :, head + 5 :]
    cut[:, 1:] = 0
    cut[:, 1:, :] = images[:1, 1:, : SIZE[1] - head - 5]
    misses = tangent_misses(rig(), outlines(cut), 1)
    assert np.isnan(misses[(np.array(pairs_of(VIEWS)) == 0).any(1)]).sum() >= VIEWS - 1
