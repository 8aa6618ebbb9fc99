"""Poses of one or of several people, by name: the same frames and skeletons for all."""

from collections.abc import Mapping

import numpy as np

from ..poses import Poses


def check_people(people: Mapping[str, Poses]) -> None:
    """Refuse poses of people that cannot be shown together.

    Raises:
        ValueError: There is nobody, or frames, rate, up axis or template differ.
    """
    if not people:
        raise ValueError("poses: there is nobody; give the poses of at least one person")
    first_name, first = next(iter(people.items()))
    for name, poses in people.items():
        same = (poses.template, poses.fps, poses.up) == (first.template, first.fps, first.up)
        if not same or not np.array_equal(poses.frame_index, first.frame_index):
            raise ValueError(
                f"{name}: has other frames, another rate, up axis or template than {first_name}; give poses of the "
                "same recording for all"
            )
