"""The grid of a stream goes with the person: in steps, or at once, and is the same grid as one made at once."""

from dataclasses import replace

import numpy as np
import pytest

from jaxskel import HullSettings, paper_settings
from jaxskel._math.rotations import turn_about
from jaxskel.pipeline._moving_grid import MovingGrid, grid_around, way_off
from jaxskel.pipeline._prepare import place, with_grid
from jaxskel.pipeline._prepared import Prepared
from jaxskel.synthetic import make_scene

SETTINGS = replace(paper_settings(), hull=HullSettings(spacing=0.06, max_misses=0))
MIDDLE = np.array([0.1, -0.2, 1.0])


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    """With the grid around `MIDDLE`, in a world in which no voxel lies between two pixels, as on a rig's axes."""
    scene, turn = make_scene(2), turn_about(np.array([[0.0, 0.0, 1.0]]), np.array([0.1]))[0]
    scene = replace(scene, cameras=scene.cameras.rotated(turn))
    return place(scene, SETTINGS, grid_around(MIDDLE, 0.06))


def moved(prepared: Prepared, middle: np.ndarray) -> Prepared:
    """With another grid, projected as a whole."""
    assert prepared.table is not None
    return with_grid(replace(prepared, table=None), grid_around(middle, 0.06), prepared.table.size, SETTINGS)


def assert_same(found: Prepared, expected: Prepared) -> None:
    assert found.table is not None
    assert expected.table is not None
    np.testing.assert_array_equal(found.table.grid.origin, expected.table.grid.origin)
    np.testing.assert_array_equal(found.table.pixels, expected.table.pixels)
    np.testing.assert_array_equal(found.table.footprints, expected.table.footprints)
    np.testing.assert_array_equal(found.table.observed, expected.table.observed)
    np.testing.assert_array_equal(found.table.cut_blocks, expected.table.cut_blocks)
    np.testing.assert_array_equal(found.edge, expected.edge)


def test_a_person_near_the_middle_leaves_the_grid_where_it_is(prepared):
    assert MovingGrid(SETTINGS).followed(prepared, MIDDLE + [0.1, 0.1, 0.0], carved=True) is prepared


def test_the_grid_moves_in_steps_before_the_person_is_far_off(prepared):
    grid, away, frames, found = MovingGrid(SETTINGS), MIDDLE + [0.25, 0.0, 0.0], 0, prepared
    while found is prepared:
        found = grid.followed(prepared, away, carved=True)
        frames += 1
    assert 1 < frames < 20
    assert_same(found, moved(prepared, away))


@pytest.mark.parametrize(("way", "carved", "at_once"), [(0.4, True, True), (0.4, False, False), (0.7, False, True)])
def test_a_person_who_is_far_off_has_the_grid_at_once_where_it_is_needed(prepared, way, carved, at_once):
    away = MIDDLE + [0.0, way, 0.0]
    found = MovingGrid(SETTINGS).followed(prepared, away, carved)
    assert (found is not prepared) == at_once
    if at_once:
        assert_same(found, moved(prepared, away))


def test_a_move_to_where_the_person_is_no_more_is_given_up(prepared):
    grid = MovingGrid(SETTINGS)
    assert grid.followed(prepared, MIDDLE + [0.25, 0.0, 0.0], carved=True) is prepared
    elsewhere = MIDDLE - [0.9, 0.0, 0.0]
    assert_same(grid.followed(prepared, elsewhere, carved=True), moved(prepared, elsewhere))


def test_how_far_off_a_person_is_counts_by_the_reach_of_limbs():
    grid = grid_around(MIDDLE, 0.06)
    centre = (np.asarray(grid.origin) + grid.upper) / 2
    assert way_off(grid, centre) == 0
    assert way_off(grid, centre + [0.0, -0.3, 0.2]) == pytest.approx(1.0)
