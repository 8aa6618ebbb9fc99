"""Sizes that are tried besides the graph's."""

import pytest

from jaxskel.body import default_adult
from jaxskel.pipeline._subject import STATURES, other_sizes


@pytest.mark.parametrize("stature", [0.81, 1.0, 1.7, 2.0, 2.16, 2.39])
def test_only_sizes_that_a_person_can_have_are_tried(stature):
    # A graph that went through an arm said 2.16 m; a body of 1.35 times that was refused, and the command ended.
    sizes = other_sizes(stature)
    assert sizes
    for size in sizes:
        assert STATURES[0] < default_adult(size * stature).stature < STATURES[1]


def test_all_are_tried_of_an_adult():
    assert other_sizes(1.7) == (0.8, 1.17, 1.35)
