"""Luggage: found where something goes with the chest, and only there."""

import numpy as np
import pytest
from support.capsule_films import ADULT, BODY, film_body, some

from jaxskel._runtime.batching import on_device
from jaxskel.body import BALL_NAMES, Body
from jaxskel.body_calibration import Addition, find_luggage
from jaxskel.synthetic import demo_motion

pytestmark = pytest.mark.slow

# Of the demo motion at 5 frames a second: two of a walk, waving, a turn, crane stand, crouch, twice hands on hips.
FRAMES = [7, 9, 18, 35, 43, 50, 55, 57]
TRUTH = some(demo_motion(ADULT), FRAMES)
BAG = [BALL_NAMES.index(f"{side}_bag_{end}") for side in "lr" for end in ("top", "low")]


def loaded(front: float, radius: float = 0.11) -> Body:
    """The body with a bag in front of the chest, or behind it (m)."""
    offsets, radii = np.array(BODY.offsets), np.array(BODY.radii)
    offsets[BAG] = [[front, side * 0.06, up] for side in (1, -1) for up in (0.34, 0.2)]
    radii[BAG] = radius
    return Body(ADULT, BODY.segments, offsets, radii, BODY.links)


def found(body: Body) -> Addition | None:
    """What is found if the body without a bag is in the true poses."""
    return find_luggage(BODY, TRUTH, on_device(film_body(TRUTH, 5.0, body).observed), np.arange(len(FRAMES)))


@pytest.mark.parametrize("front", [-0.2, 0.24])
def test_a_bag_is_where_it_is(front):
    luggage = found(loaded(front))
    assert luggage is not None
    true = loaded(front)
    np.testing.assert_allclose(luggage.ends, np.asarray(true.offsets)[BAG[:2]], atol=0.08)
    assert luggage.radius == pytest.approx(0.11, abs=0.04)


def test_a_body_without_a_bag_carries_nothing():
    assert found(BODY) is None


def test_a_bag_that_hides_in_the_chest_is_none():
    assert found(loaded(0.0, 0.03)) is None
