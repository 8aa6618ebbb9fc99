"""Random people: each seed gives a different person, and all are adults."""

import numpy as np
import pytest

from jaxskel import default_adult
from jaxskel.body import LENGTH_NAMES, adults, lengths_of
from jaxskel.synthetic import draw_adult


@pytest.mark.parametrize("stature", [1.5, 1.9])
def test_stature_is_as_asked_and_flesh_grows_with_it(stature):
    body, usual = draw_adult(3, stature), draw_adult(3)
    assert body.skeleton.stature == pytest.approx(stature)
    np.testing.assert_allclose(body.radii / np.asarray(usual.radii), stature / 1.72, rtol=1e-6)


def test_a_seed_is_a_person():
    one, same, other = (draw_adult(seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.radii, same.radii)
    assert np.abs(lengths_of(one.skeleton) / lengths_of(other.skeleton) - 1).max() > 0.02


@pytest.mark.slow
def test_people_differ_about_the_mean_as_the_table_says():
    table, usual = adults(), lengths_of(default_adult())
    people = [draw_adult(seed) for seed in range(200)]
    drawn = np.array([np.log(lengths_of(body.skeleton) / usual) for body in people])
    trunk, hip = (table.names.index(name) for name in ("trunk", "hip"))
    # All have one stature, so of two lengths the ratio tells.
    ratios = drawn[:, LENGTH_NAMES.index("hip")] - drawn[:, LENGTH_NAMES.index("trunk")]
    axes, rest = table.axes[hip] - table.axes[trunk], np.hypot(table.rest[hip], table.rest[trunk])
    spread = np.hypot(np.linalg.norm(axes), rest)
    assert ratios.mean() == pytest.approx(table.means[hip] - table.means[trunk], abs=0.3 * spread)
    assert ratios.std() == pytest.approx(spread, rel=0.25)
