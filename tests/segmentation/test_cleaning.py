"""Silhouettes without specks, holes and strangers, on drawn ones."""

from dataclasses import replace

import numpy as np

from jaxskel.segmentation import Cleaning

SIZE = (240, 320)
EVERYWHERE = np.ones(SIZE, bool)


def figure() -> np.ndarray:
    """A trunk with an arm, a gap of 10 px between them that is closed above and below: a real hole."""
    mask = np.zeros(SIZE, bool)
    mask[40:220, 130:190] = True
    mask[70:150, 190:215] = True
    mask[85:140, 190:200] = False
    return mask


def test_cleaning_leaves_a_clean_figure_and_its_hole():
    # But for a pixel at its corners.
    assert (Cleaning().apply(figure()) ^ figure()).sum() <= 24
    assert not Cleaning().apply(figure())[90:135, 191:199].any()


def test_cleaning_fills_specks_and_takes_strangers_away():
    mask = figure()
    mask[100:103, 150:153] = False
    mask[30:60, 20:50] = True
    mask[200, 300] = True
    cleaned = Cleaning().apply(mask)
    assert cleaned[100:103, 150:153].all()
    assert not cleaned[:, :100].any()
    assert not cleaned[200, 300]


def test_cleaning_keeps_a_head_that_a_collar_parts_from_the_trunk():
    mask = figure()
    mask[60:63, 130:190] = False
    cleaned = Cleaning().apply(mask)
    assert cleaned[45, 160]
    assert cleaned[61, 160]


def test_each_step_of_cleaning_is_a_switch():
    mask = figure()
    mask[30:60, 20:50] = True
    mask[100:104, 150:154] = False
    mask[230, 300] = True
    nothing = Cleaning(smooth=False, largest=False, fill=False)
    assert (nothing.apply(mask) == mask).all()
    assert not replace(nothing, smooth=True).apply(mask)[230, 300]
    assert not replace(nothing, largest=True).apply(mask)[:, :100].any()
    assert replace(nothing, fill=True).apply(mask)[100:104, 150:154].all()


def test_cleaning_nothing_gives_nothing():
    assert not Cleaning().apply(np.zeros(SIZE, bool)).any()
    assert Cleaning().apply(EVERYWHERE).all()


def test_cleaning_keeps_the_silhouette_where_it_is():
    mask = figure()
    assert (Cleaning().apply(mask[:, ::-1])[:, ::-1] == Cleaning().apply(mask)).all()
    assert (Cleaning().apply(mask[::-1])[::-1] == Cleaning().apply(mask)).all()
